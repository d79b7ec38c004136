"""An arm that has been learned, and what it would learn from a motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.expected_error import ExpectedError, States
from lip_id_ros.excitation.series import FourierMotion
from lip_id_ros.friction.compiled import friction_features
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.regressor_pullback import placement_pullback, regressor_pullback
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS, placement_derivatives

STEPS = 1e-5, 1e-6, 1e-4, 1e-4
"""Of q, dq, ddq and the load, for differences of friction alone."""


class KnownArm:
    """A posterior of placements, links and friction, with gradients of its Jacobian."""

    def __init__(self, arm: ArmPosterior) -> None:
        self._arm = arm
        self.root, self.noise = arm.covariance_root, arm.noise.std
        n = len(arm.links)
        self._placements, self._rigid = DIRECTIONS * n, (DIRECTIONS + LINK_PARAMETERS) * n
        whole = arm.friction.basis.with_shapes()
        has_widths = len(self.root) > self._rigid + arm.friction.basis.size
        self._basis = whole if has_widths else arm.friction.basis
        self._loaded = bool(arm.friction.basis.is_loaded.any())

    def jacobian(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the torques by the coordinates of the posterior, shape (N, n, p)."""
        return self._arm.jacobian_of_coordinates(q, dq, ddq)

    def pullback(self, weights: Array, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the sum of weights (N, n, p) times the Jacobian, shape (3, N, n)."""
        chain, links = self._arm.chain, self._arm.links
        q, dq, ddq = map(np.ascontiguousarray, (q, dq, ddq))
        regressor = torque_regressor(chain, q, dq, ddq)
        load = regressor @ links.ravel()
        of_rigid, of_friction = weights[..., : self._rigid], weights[..., self._rigid :]
        carried = None
        if self._loaded:
            placements = placement_derivatives(chain, links, q, dq, ddq)
            rigid = np.concatenate([placements.reshape(*q.shape, -1), regressor], axis=2)
            carried = np.einsum('tic,tjc->tij', of_rigid, rigid)
            slopes = self._arm.friction.load_slopes(q, dq, ddq, load)
            of_rigid = of_rigid + np.einsum('tij,tic->tjc', slopes, of_rigid)
        *out, by_load = self._by_friction(of_friction, carried, [q, dq, ddq, load])
        of_links = of_rigid[..., self._placements :] + by_load[..., None] * links.ravel()
        of_placements = np.ascontiguousarray(of_rigid[..., : self._placements])
        found = np.array(out) + regressor_pullback(
            chain, np.ascontiguousarray(of_links), q, dq, ddq
        )
        return np.asarray(found + placement_pullback(chain, links, of_placements, q, dq, ddq))

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the torques of links and friction, shape (N, n) [N m or N]."""
        return self._arm.torque(q, dq, ddq)

    def torque_pullback(self, weights: Array, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the sum of weights (N, n) times the torques, shape (3, N, n)."""
        chain, links = self._arm.chain, self._arm.links.ravel()
        q, dq, ddq = map(np.ascontiguousarray, (q, dq, ddq))
        load = torque_regressor(chain, q, dq, ddq) @ links
        coefficients = np.zeros(self._basis.size)
        coefficients[: self._arm.friction.basis.size] = self._arm.friction.coefficients
        of_friction = weights[..., None] * coefficients
        *out, by_load = self._by_friction(of_friction, None, [q, dq, ddq, load])
        of_links = (weights + by_load)[..., None] * links
        return np.array(out) + regressor_pullback(chain, of_links, q, dq, ddq)

    def _by_friction(
        self, weights: Array, carried: Array | None, states: list[Array]
    ) -> list[Array]:
        """
        Differentiate by q, dq, ddq and load what friction has in the sum, each shape (N, n).

        `carried`, shape (N, n, n): weights of the slopes of friction by load.
        """
        out = [np.zeros_like(each) for each in states]
        for which, step in enumerate(STEPS):
            if which == len(STEPS) - 1 and not self._loaded:
                break
            for joint in range(states[0].shape[1]):
                ahead, back = (
                    self._friction(weights, carried, _moved(states, which, joint, by))
                    for by in (step, -step)
                )
                out[which][:, joint] = (ahead - back) / (2.0 * step)
        return out

    def _friction(self, weights: Array, carried: Array | None, states: list[Array]) -> Array:
        q, dq, ddq, load = states
        features = friction_features(self._basis, q, dq, ddq, load)
        value = np.einsum('tik,tik->t', weights, features)
        if carried is not None:
            slopes = self._arm.friction.load_slopes(q, dq, ddq, load)
            value = value + np.einsum('tij,tij->t', slopes, carried)
        return np.asarray(value)


def _moved(states: list[Array], which: int, joint: int, by: float) -> list[Array]:
    out = list(states)
    out[which] = states[which].copy()
    out[which][:, joint] += by
    return out


STATES = 400
"""Of the motion, for the posterior after it."""


@dataclass(frozen=True, eq=False)
class Learning:
    """A model before a motion of so many independent states, and its expectation at targets."""

    before: InverseDynamicsModel
    targets: States
    motion: FourierMotion
    measurements: float

    @cached_property
    def after(self) -> InverseDynamicsModel:
        """The same mean, with the covariance that is expected after the motion."""
        arm = self.before.arm
        assert arm is not None, 'a motion is designed for an arm'
        t = np.linspace(0.0, self.motion.duration, STATES, endpoint=False)
        error = ExpectedError(KnownArm(arm), self.targets, self.measurements, STATES)
        root = error.root_after(*self.motion.sample(t))
        return replace(self.before, arm=replace(arm, covariance_root=root))

    @property
    def torque_std(self) -> Array:
        """Root mean square deviations of torques at the targets, before and after, (2, n)."""
        return self._std(*self.targets)

    @property
    def gravity_std(self) -> Array:
        """The same of torques at rest at the targets, shape (2, n)."""
        still = np.zeros_like(self.targets[0])
        return self._std(self.targets[0], still, still)

    def _std(self, q: Array, dq: Array, ddq: Array) -> Array:
        found = [model.torque_std(q, dq, ddq) for model in (self.before, self.after)]
        return np.sqrt(np.mean(np.square(found), axis=1))
