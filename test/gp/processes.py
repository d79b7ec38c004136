"""The Gaussian processes of models that are known to have them."""

from __future__ import annotations

from lip_id_ros.kernels import TorquePosterior
from lip_id_ros.model import InverseDynamicsModel


def process_of(model: InverseDynamicsModel) -> TorquePosterior:
    """Return the Gaussian process posterior of a model."""
    assert model.process is not None
    return model.process
