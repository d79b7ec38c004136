"""Which samples a method learns from: the same ones as our fit takes."""

from __future__ import annotations

from lip_id_ros.dataset import Dataset
from lip_id_ros.gp.subset import spread
from lip_id_ros.kernels import JointBasis


def covering(dataset: Dataset, basis: JointBasis, count: int) -> Dataset:
    """Return the `count` samples that cover the motion best, all where there are not more."""
    return dataset.select(spread(basis, dataset.q, dataset.dq, dataset.ddq, count))
