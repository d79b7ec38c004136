"""Standard deviations of the posterior: what the posterior mean does not need."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import JointStates
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.model import StandardDeviation, TrainedModel

BLOCK = 64
"""Queries per block: bounds the memory of the covariances with the training samples."""


class Uncertainty:
    """
    Posterior variances of a model (paper, eqs. `GP-posterior` and section `sec:energy_est`).

    Construction factorises the Gram matrix: (n N)^3 / 3 operations and (n N)^2 numbers.

    """

    def __init__(self, model: TrainedModel) -> None:
        self._model = model
        self._prior = model.prior
        self._factor = CholeskyFactor.of(model.prior.noisy_gram(model.states))
        self._reference = np.zeros((1, model.n_joints))
        if model.has_potential:
            self._reference = model.potential_reference[None]

    def standard_deviation(self, q: Array, dq: Array, ddq: Array) -> StandardDeviation:
        """
        Evaluate at joint states, each of shape (N, n).

        Raises
        ------
        ShapeError
            If the shapes are wrong.

        """
        tau, kinetic, potential = np.empty_like(q), np.empty(len(q)), np.empty(len(q))
        for start in range(0, len(q), BLOCK):
            rows = slice(start, start + BLOCK)
            x = self._prior.kernel.states(q[rows], dq[rows], ddq[rows])
            tau[rows], kinetic[rows], potential[rows] = self._variances(x)
        has_potential = self._model.has_potential
        return StandardDeviation(
            np.sqrt(tau), np.sqrt(kinetic), np.sqrt(potential) if has_potential else None
        )

    def _variances(self, x: JointStates) -> tuple[Array, Array, Array]:
        prior, training = self._prior, self._model.states
        torque = self._explained(prior.cross_gram(x, training)).reshape(len(x), -1)
        kinetic, potential = prior.energy_covariance(x, training)
        at = prior.kernel.states(self._reference, *[np.zeros_like(self._reference)] * 2)
        _, reference = prior.energy_covariance(at, training)
        difference = self._prior_difference(x.q)
        return (
            np.maximum(prior.torque_variance(x) - torque, 0.0),
            np.maximum(prior.kinetic_variance(x) - self._explained(kinetic), 0.0),
            np.maximum(difference - self._explained(potential - reference), 0.0),
        )

    def _explained(self, covariance: Array) -> Array:
        half = self._factor.half_solve(covariance.T)
        return np.asarray(np.einsum('kt,kt->t', half, half))

    def _prior_difference(self, q: Array) -> Array:
        covariance = self._prior.potential_covariance
        reference = self._reference
        return covariance(q, q) - 2.0 * covariance(q, reference) + covariance(reference, reference)
