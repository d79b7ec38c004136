"""An arm as a set of parameters with a joint posterior (docs/maths.md, section 13)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.model import FrictionBasis, FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.energy_derivatives import energy_derivatives
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)
from lip_id_ros.rigid_body.rnea_derivatives import placement_derivatives


@dataclass(frozen=True, eq=False)
class ArmPosterior:
    """
    Chain, links and friction of an arm with their joint covariance.

    Coordinates of the covariance are, in this order: small rotations about the axes of each
    joint's own frame and translations in its parent, joint by joint (6 n); the parameters of the
    links (11 n); the coefficients of friction (K).

    Attributes
    ----------
    chain : Chain
    links : array, shape (n, 11)
        Parameters of bodies that can exist.
    friction : FrictionModel
    noise : TorqueNoise
        Of measured torques about the model.
    covariance_root : array, shape (17 n + K, r)
        S with covariance S S^T.

    """

    chain: Chain
    links: Array
    friction: FrictionModel
    noise: TorqueNoise
    covariance_root: Array

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """
        Return the torques of links and friction.

        Parameters
        ----------
        q, dq, ddq : arrays, shape (N, n)

        Returns
        -------
        array, shape (N, n)
            [N m or N].

        """
        links = torque_regressor(self.chain, *_contiguous(q, dq, ddq)) @ self.links.ravel()
        return np.asarray(links + self.friction.torque(q, dq, links))

    def jacobian(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the torques by the coordinates, shape (N, n, 17 n + K) [N m or N]."""
        state = _contiguous(q, dq, ddq)
        regressor = torque_regressor(self.chain, *state)
        placements = placement_derivatives(self.chain, self.links, *state)
        load = regressor @ self.links.ravel()
        friction = friction_features(self.friction.basis, q, dq, load)
        return np.concatenate([placements.reshape(*dq.shape, -1), regressor, friction], axis=2)

    def torque_std(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return standard deviations of the noiseless torques, shape (N, n) [N m or N]."""
        spread = self.jacobian(q, dq, ddq) @ self.covariance_root
        variance: Array = np.sum(spread**2, axis=2)
        return np.sqrt(variance)

    def energy_std(self, q: Array, dq: Array, reference: Array) -> tuple[Array, Array]:
        """
        Return standard deviations of both energies.

        Parameters
        ----------
        q, dq : arrays, shape (N, n)
        reference : array, shape (n,)
            Positions at which the potential energy is zero and certain.

        Returns
        -------
        kinetic, potential : arrays, shape (N,)
            [J].

        """
        kinetic, potential = self._energy_jacobians(*_contiguous(q, dq))
        at = _contiguous(reference[None])[0]
        potential = potential - self._energy_jacobians(at, np.zeros_like(at))[1]
        first = self.covariance_root[: kinetic.shape[1]]
        return np.linalg.norm(kinetic @ first, axis=1), np.linalg.norm(potential @ first, axis=1)

    def _energy_jacobians(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """Differentiate T and V by placements and link parameters, shapes (N, 17 n) [J]."""
        kinetic, potential = energy_derivatives(self.chain, self.links, q, dq)
        return (
            np.hstack([kinetic.reshape(len(q), -1), kinetic_regressor(self.chain, q, dq)]),
            np.hstack([potential.reshape(len(q), -1), potential_regressor(self.chain, q)]),
        )

    def measurement_std(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return standard deviations of measured torques, shape (N, n) [N m or N]."""
        return np.hypot(self.torque_std(q, dq, ddq), self.noise.std_at(dq))


def friction_features(basis: FrictionBasis, q: Array, dq: Array, load: Array) -> Array:
    """
    Return the features of friction for all torques.

    Parameters
    ----------
    basis : FrictionBasis
    q, dq, load : arrays, shape (N, n)

    Returns
    -------
    array, shape (N, n, K)

    """
    out = np.zeros((*q.shape, basis.size))
    features = basis.features(q, dq, load)
    for joint, (rows, columns) in enumerate(zip(features, basis.columns(), strict=True)):
        for column, row in zip(columns, rows.T, strict=True):
            out[:, joint, column] += row
    return out


def _contiguous(*arrays: Array) -> tuple[Array, ...]:
    return tuple(np.ascontiguousarray(x, dtype=np.float64) for x in arrays)
