"""The Gaussian processes of models that are known to have them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.kernels import TorquePosterior, TorquePrior
from lip_id_ros.model import InverseDynamicsModel


def process_of(model: InverseDynamicsModel) -> TorquePosterior:
    assert model.process is not None
    return model.process


def with_prior(process: TorquePosterior, prior: TorquePrior) -> TorquePosterior:
    """Condition another prior on the samples of a process, with the noise that it has."""
    given = TorquePosterior(prior, process.states, process.tau, np.empty_like(process.tau))
    alpha = given.factor.solve(process.tau.ravel()).reshape(process.tau.shape)
    return replace(given, alpha=alpha)
