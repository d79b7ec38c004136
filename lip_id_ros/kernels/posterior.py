"""Gaussian process posteriors of torques and energies: a prior conditioned on samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.prior import JointStates, TorquePrior
from lip_id_ros.linear_algebra import CholeskyFactor

BLOCK = 64
"""Queries per block: bounds the memory of the covariances with the training samples."""


@dataclass(frozen=True, eq=False)
class TorquePosterior:
    """
    Gaussian process posterior of torques and energies.

    Attributes
    ----------
    prior : TorquePrior
        Kernels and optimised hyperparameters.
    states : JointStates
        The N samples that the posterior is conditioned on.
    tau : array, shape (N, n)
        Their measured torques [N m or N].
    alpha : array, shape (N, n)
        (K + noise)^-1 tau: the weights of the posterior mean.

    """

    prior: TorquePrior
    states: JointStates
    tau: Array
    alpha: Array

    @classmethod
    def condition(cls, prior: TorquePrior, states: JointStates, tau: Array) -> TorquePosterior:
        """
        Condition a prior on samples.

        Raises
        ------
        FitError
            If the Gram matrix cannot be factorised.

        """
        factor = CholeskyFactor.of(prior.noisy_gram(states))
        return cls(prior, states, tau, factor.solve(tau.ravel()).reshape(tau.shape))

    @cached_property
    def factor(self) -> CholeskyFactor:
        """Factor of the noisy Gram matrix: (n N)^3 / 3 operations and (n N)^2 numbers."""
        return CholeskyFactor.of(self.prior.noisy_gram(self.states))

    @property
    def noise_std(self) -> Array:
        """Standard deviation of each torque's measurement noise, shape (n,) [N m or N]."""
        return np.sqrt(self.prior.hyperparameters.noise_variance)

    def variances(
        self, q: Array, dq: Array, ddq: Array, reference: Array
    ) -> tuple[Array, Array, Array]:
        """
        Posterior variances (paper, eqs. `GP-posterior` and section `sec:energy_est`).

        Parameters
        ----------
        q, dq, ddq : arrays, shape (N, n)
        reference : array, shape (n,)
            Positions at which the potential energy is zero and certain.

        Returns
        -------
        tau : array, shape (N, n)
            Of noiseless torques [(N m)^2 or N^2].
        kinetic, potential : arrays, shape (N,)
            [J^2].

        """
        tau, kinetic, potential = np.empty_like(q), np.empty(len(q)), np.empty(len(q))
        for start in range(0, len(q), BLOCK):
            rows = slice(start, start + BLOCK)
            x = self.prior.kernel.states(q[rows], dq[rows], ddq[rows])
            tau[rows], kinetic[rows], potential[rows] = self._block(x, reference[None])
        return tau, kinetic, potential

    def _block(self, x: JointStates, reference: Array) -> tuple[Array, Array, Array]:
        prior, training = self.prior, self.states
        torque = self._explained(prior.cross_gram(x, training))
        kinetic, potential = prior.energy_covariance(x, training)
        still = np.zeros_like(reference)
        at = prior.kernel.states(reference, still, still)
        _, of_reference = prior.energy_covariance(at, training)
        covariance = prior.potential_covariance
        difference = (
            covariance(x.q, x.q)
            - 2.0 * covariance(x.q, reference)
            + covariance(reference, reference)
        )
        return (
            np.maximum(prior.torque_variance(x) - torque.reshape(x.q.shape), 0.0),
            np.maximum(prior.kinetic_variance(x) - self._explained(kinetic), 0.0),
            np.maximum(difference - self._explained(potential - of_reference), 0.0),
        )

    def _explained(self, covariance: Array) -> Array:
        half = self.factor.half_solve(covariance.T)
        return np.asarray(np.einsum('kt,kt->t', half, half))
