"""
An arm as it is known before a motion: not at all, or by a model, and what it would learn.

Where no model says what is worth knowing, a motion should teach whatever arm it moves. So some
chains are drawn as robots have them, with links and friction of any size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.expected_error import ExpectedError, States
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import FourierMotion
from lip_id_ros.friction.compiled import friction_features, FrictionFeatures
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS, STANDARD_GRAVITY
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.regressor_pullback import placement_pullback, regressor_pullback
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS, placement_derivatives

LINK_STD = np.array([3.0, *[0.5] * 3, *[0.1] * 6, 0.2])
"""Of mass, first moments, inertias and rotor [kg, kg m, kg m^2]."""

FRICTION_STD = np.array([0.2, 0.2, 0.05])
"""Torque of viscous friction at full speed, of Coulomb friction and of an offset, in the root mean
square torque of the links."""

NOISE = 0.03
"""In the root mean square torque of the links."""

SIGN_WIDTH = 0.02
"""Of the smooth sign, in the largest velocity."""

PARALLEL = 0.3
"""Share of axes that are parallel to the one before; the others are at right angles."""

LENGTH = 0.25
"""Standard deviation of the components of translations between axes [m]."""


@dataclass(frozen=True, eq=False)
class UnknownArm:
    """
    A chain with links and friction that may have any size.

    Coordinates: parameters of the links (11 n); viscous and Coulomb friction and an offset of each
    joint (3 n). `sign_widths`, shape (n,).
    """

    chain: Chain
    root: Array
    noise: Array
    sign_widths: Array

    def jacobian(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the torques by the coordinates, shape (N, n, 14 n)."""
        links = torque_regressor(self.chain, *map(np.ascontiguousarray, (q, dq, ddq)))
        signs = np.tanh(dq / self.sign_widths)
        own = [_on_diagonal(column) for column in (dq, signs, np.ones_like(dq))]
        return np.concatenate([links, *own], axis=2)

    def pullback(self, weights: Array, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the sum of weights (N, n, 14 n) times the Jacobian, shape (3, N, n)."""
        n = q.shape[1]
        states = map(np.ascontiguousarray, (q, dq, ddq))
        of_links = np.ascontiguousarray(weights[..., : LINK_PARAMETERS * n])
        out = regressor_pullback(self.chain, of_links, *states)
        viscous, coulomb, _ = np.split(weights[..., LINK_PARAMETERS * n :], 3, axis=2)
        signs = np.tanh(dq / self.sign_widths)
        out[1] += np.einsum('tjj->tj', viscous)
        out[1] += np.einsum('tjj->tj', coulomb) * (1.0 - signs**2) / self.sign_widths
        return np.asarray(out)


def unknown_arm(
    limits: JointLimits, joint_types: Sequence[str], targets: States, rng: np.random.Generator
) -> UnknownArm:
    """Draw an arm; its friction and noise follow from the torques of its links at targets."""
    chain = random_chain(joint_types, rng)
    n = len(joint_types)
    of_links = np.tile(LINK_STD, n)
    regressor = torque_regressor(chain, *map(np.ascontiguousarray, targets))
    size = np.sqrt(np.mean(np.sum((regressor * of_links) ** 2, axis=2), axis=0))
    friction = FRICTION_STD[:, None] * size
    friction[0] /= limits.velocity
    root = np.diag(np.concatenate([of_links, friction.ravel()]))
    return UnknownArm(chain, root, NOISE * size, SIGN_WIDTH * limits.velocity)


def random_chain(joint_types: Sequence[str], rng: np.random.Generator) -> Chain:
    """Draw a chain on an upright base, with axes that are parallel or at right angles."""
    n = len(joint_types)
    rotations = np.tile(np.eye(3), (n, 1, 1))
    for i in range(1, n):
        if rng.uniform() > PARALLEL:
            turn = rng.uniform(0.0, 2.0 * np.pi)
            about_z = np.array(
                [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
            )
            rotations[i] = about_z @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    translations = LENGTH * rng.standard_normal((n, 3))
    gravity = np.array([0.0, 0.0, -STANDARD_GRAVITY])
    return Chain(rotations, translations, is_prismatic(joint_types), gravity)


def _on_diagonal(columns: Array) -> Array:
    return np.asarray(columns[:, :, None] * np.eye(columns.shape[1]))


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
        features = FrictionFeatures(arm.friction.basis)
        self._slopes = partial(features.load_slopes, arm.friction.coefficients)

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
            slopes = self._slopes(q, dq, ddq, load)
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
            slopes = self._slopes(q, dq, ddq, load)
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

    @property
    def inertia_std(self) -> Array:
        """The same of the inertias M_jj [kg m^2 or kg], torques of one unit of ddq alone."""
        q, n = self.targets[0], self.targets[0].shape[1]
        still, arms = np.zeros_like(q), (self.before.arm, self.after.arm)
        out = np.empty((len(arms), n))
        for which, arm in enumerate(arms):
            assert arm is not None, 'a motion is designed for an arm'
            at_rest = arm.jacobian_of_coordinates(q, still, still)
            for j in range(n):
                moved = arm.jacobian_of_coordinates(q, still, still + np.eye(n)[j])
                spread = (moved - at_rest)[:, j] @ arm.covariance_root
                out[which, j] = np.sqrt(np.mean(np.sum(spread**2, axis=1)))
        return out

    def _std(self, q: Array, dq: Array, ddq: Array) -> Array:
        found = [model.torque_std(q, dq, ddq) for model in (self.before, self.after)]
        return np.sqrt(np.mean(np.square(found), axis=1))
