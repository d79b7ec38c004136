"""A Gaussian prior on the parameters of rigid links, as a kernel on torques and energies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body.chain import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)

ARTICULATED = 'articulated'
"""Name of kernels that have rigid links beside their energy kernel."""


@dataclass(frozen=True, eq=False)
class RigidLinks:
    """
    Rigid links with joints in given places (docs/maths.md, section 10).

    All torques and energies are linear in the parameters of the links, which are independent and
    normal around zero. Features are those of parameters in units of their standard deviations, so
    that a covariance is the inner product of features.

    Attributes
    ----------
    chain : Chain
        Where the joints are.
    deviations : array, shape (n, 11)
        Prior standard deviations of the parameters.

    """

    chain: Chain
    deviations: Array

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Features of the torques at joint states of shape (N, n), shape (N, n, 11 n)."""
        state = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq))
        return torque_regressor(self.chain, *state) * self.deviations.ravel()

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Features of the kinetic energy, shape (N, 11 n)."""
        state = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq))
        return kinetic_regressor(self.chain, *state) * self.deviations.ravel()

    def potential(self, q: Array) -> Array:
        """Features of the potential energy, relative to the base, shape (N, 11 n)."""
        positions = np.ascontiguousarray(q, dtype=np.float64)
        return potential_regressor(self.chain, positions) * self.deviations.ravel()

    def parameters(self, features: Array, alpha: Array) -> Array:
        """
        Posterior mean of the parameters.

        Parameters
        ----------
        features : array, shape (N n, 11 n)
            Of the torques of the training samples.
        alpha : array, shape (N, n)
            Weights of the posterior mean.

        Returns
        -------
        array, shape (n, 11)

        """
        weights = alpha.ravel() @ features
        return self.deviations * weights.reshape(-1, LINK_PARAMETERS)
