"""Forward dynamics: the accelerations of an arm of links and friction under given torques."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError
from lip_id_ros.friction.compiled import add_friction, CompiledFriction
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import Lag, Presliding
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.numba_jit import jit
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.rnea import inertial_torque, Links, rnea, WORK_VECTORS

SLOPE = 1e-4
"""Difference of velocities by which friction is differentiated [rad/s or m/s]."""


@dataclass(frozen=True, eq=False)
class ForwardDynamics:
    """Links, shape (n, 11), and friction of an arm that is simulated."""

    chain: Chain
    links: Array
    friction: FrictionModel

    @classmethod
    def fitted(cls, arm: ArmPosterior) -> ForwardDynamics:
        """Return links and friction of a model; a residual_gp is left out."""
        return cls(arm.chain, arm.links, arm.friction)

    @cached_property
    def _compiled(self) -> tuple[Links, CompiledFriction]:
        kept = [not isinstance(x.term, Presliding | Lag) for x in self.friction.basis.terms]
        return Links(self.chain, self.links), CompiledFriction.of(self.friction.with_terms(kept))

    def acceleration(self, q: Array, dq: Array, tau: Array, before: Array, step: float) -> Array:
        """
        Return accelerations (W, n) at states and torques (W, n); DataError if an M(q) is singular.

        Friction is taken implicitly over a step [s], since its sign turns within less, and without
        pre-sliding or lag: several accelerations can solve the equations with them. `before`,
        shape (W, n): accelerations of the step before, which load and smooth friction.
        """
        bias, inertia = equations_of_motion(*self._compiled, q, dq, before, step)
        try:
            return np.linalg.solve(inertia, (tau - bias)[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError as error:
            raise DataError(
                'links with inertia were expected, but M(q) is singular, so that no acceleration '
                'follows from a torque; give a URDF with inertials.'
            ) from error

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the torques, shape (N, n), that give accelerations (N, n) at once."""
        q, dq, ddq = (np.array(values) for values in (q, dq, ddq))  # compiled for writable ones
        bias, inertia = equations_of_motion(*self._compiled, q, dq, ddq, 0.0)
        return np.asarray(bias + np.einsum('tij,tj->ti', inertia, ddq))


@jit
def equations_of_motion(
    links: Links, friction: CompiledFriction, q: Array, dq: Array, before: Array, step: float
) -> tuple[Array, Array]:
    """
    Return what W arms have to accelerate against (W, n), and with what inertia (W, n, n).

    The first is Coriolis, gravity and friction torques at states (W, n); `before` is the
    acceleration of the step before. The second is M(q), and on its diagonal the step [s] times the
    slope of friction by velocity.
    """
    count, n = q.shape
    bias, inertia = np.zeros((count, n)), np.zeros((count, n, n))
    work, units, still = np.empty((n, WORK_VECTORS, 3)), np.eye(n), np.zeros(n)
    for w in range(count):
        gravity, rubbing, faster = np.zeros(n), np.zeros(n), np.zeros(n)
        rnea(bias[w], gravity, links, work, q[w], dq[w], still)
        for j in range(n):
            inertial_torque(inertia[w, j], links, work, units[j])
        bias[w] += gravity
        load = bias[w] + inertia[w] @ before[w]
        add_friction(friction, q[w], dq[w], before[w], load, rubbing)
        add_friction(friction, q[w], dq[w] + SLOPE, before[w], load, faster)
        bias[w] += rubbing
        for j in range(n):
            inertia[w, j, j] += step * max((faster[j] - rubbing[j]) / SLOPE, 0.0)
    return bias, inertia
