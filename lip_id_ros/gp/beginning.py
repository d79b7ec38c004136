"""Where the optimisation of a kernel begins: from torques alone, or from links found in them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import FitError
from lip_id_ros.gp.initial import (
    initial_hyperparameters,
    initial_weights,
    NOISE_SHARE,
    starting_points,
)
from lip_id_ros.gp.log_vector import to_vector
from lip_id_ros.gp.placement_search import find_links, Samples
from lip_id_ros.gp.subset import spread
from lip_id_ros.kernels import ARTICULATED, Hyperparameters, TorqueKernel
from lip_id_ros.kernels.jointwise import Friction, own_joint_columns
from lip_id_ros.kernels.program import EnergyKernel, none
from lip_id_ros.linear_algebra import NOT_FINITE
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

MANY_SAMPLES, FEW_SAMPLES = 500, 100
"""That placements are fitted to in the end, and that the first descents make do with."""

LEAST_PER_JOINT = 2
"""Samples per joint with fewer of which placements fit anything, and say nothing."""

WORTH = 1.0
"""By how much each hyperparameter of the energies must raise the log likelihood (Akaike 1974)."""


@dataclass(frozen=True)
class Start:
    """
    One place from which the optimisation may begin.

    Attributes
    ----------
    kernel : TorqueKernel
    centre : Hyperparameters
        Of the prior on the hyperparameters.
    hyperparameters : Hyperparameters
    handicap : float
        By so much its log likelihood must be better than another's.

    """

    kernel: TorqueKernel
    centre: Hyperparameters
    hyperparameters: Hyperparameters
    handicap: float = 0.0


Begin = Callable[[TorqueKernel, Dataset, FitSettings, Progress], list[Start]]


def from_torques(
    kernel: TorqueKernel, dataset: Dataset, settings: FitSettings, progress: Progress
) -> list[Start]:
    """Begin with energies that explain all of the torques."""
    centre = _centre(kernel, dataset)
    return [Start(kernel, centre, start) for start in starting_points(centre)]


def from_links(
    kernel: TorqueKernel, dataset: Dataset, settings: FitSettings, progress: Progress
) -> list[Start]:
    """
    Find the links first, and begin with them alone, with energies beside them, or without them.

    The latter two are for arms that are no chain of rigid links.

    """
    energies = from_torques(kernel, dataset, settings, progress)
    if dataset.n_samples < LEAST_PER_JOINT * dataset.n_joints:
        return energies
    centre = energies[0].centre
    rows = spread(kernel.basis, dataset.q, dataset.dq, dataset.ddq, MANY_SAMPLES)
    some = dataset.select(rows)
    samples = Samples(some, _friction_features(kernel, centre, some))
    found = find_links(samples, FEW_SAMPLES, settings.seed, progress)
    variance = found.left_over**2

    def with_links(energy: EnergyKernel) -> tuple[TorqueKernel, Hyperparameters]:
        weights = initial_weights(energy, dataset.ddq, variance)
        linked = replace(kernel, energy=energy, links=(found.links,))
        return linked, replace(centre, weights=weights, noise_variance=variance)

    alone, centre_alone = with_links(none(dataset.n_joints))
    both, centre_both = with_links(kernel.energy)
    handicap = WORTH * sum(values.size for values in centre.weights)
    little_noise = replace(centre_both, noise_variance=(NOISE_SHARE * found.left_over) ** 2)
    return [
        Start(alone, centre_alone, centre_alone),
        Start(both, centre_both, centre_both, handicap),
        Start(both, little_noise, little_noise, handicap),
        *(replace(start, handicap=handicap) for start in energies),
    ]


BEGINNINGS: dict[str, Begin] = {ARTICULATED: from_links}
"""Of the kernels that do not begin from torques alone."""


def _centre(kernel: TorqueKernel, dataset: Dataset) -> Hyperparameters:
    with np.errstate(over='ignore', divide='ignore'):
        centre = initial_hyperparameters(
            kernel.energy, kernel.jointwise, dataset.dq, dataset.ddq, dataset.tau
        )
        if np.isfinite(to_vector(centre)).all():
            return centre
    raise FitError(NOT_FINITE)


def _friction_features(
    kernel: TorqueKernel, hyperparameters: Hyperparameters, dataset: Dataset
) -> Array:
    features = [np.zeros((dataset.n_samples, dataset.n_joints, 0))]
    for term, variances in zip(kernel.jointwise, hyperparameters.jointwise, strict=True):
        if isinstance(term, Friction):
            inputs = term.inputs(dataset.q, dataset.dq, dataset.ddq)
            features.append(own_joint_columns(inputs * np.sqrt(variances)[:, None]))
    return np.concatenate(features, axis=2)
