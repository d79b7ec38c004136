"""
An arm as it is known before a motion: not at all, or by a model, and what it would learn.

Where no model says what is worth knowing, a motion should teach whatever arm it moves. So some
chains are drawn as robots have them, with links and friction of any size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.expected_error import ExpectedError, Learner, States
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import FourierMotion
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import Chain, STANDARD_GRAVITY
from lip_id_ros.rigid_body.regressor import torque_regressor

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


def unknown_arm(
    limits: JointLimits, joint_types: Sequence[str], targets: States, rng: np.random.Generator
) -> Learner:
    """
    Draw an arm; its friction and noise follow from the torques of its links at targets.

    Coordinates: parameters of the links (11 n); viscous and Coulomb friction and an offset of each
    joint (3 n).
    """
    chain = random_chain(joint_types, rng)
    n = len(joint_types)
    of_links = np.tile(LINK_STD, n)
    regressor = torque_regressor(chain, *map(np.ascontiguousarray, targets))
    size = np.sqrt(np.mean(np.sum((regressor * of_links) ** 2, axis=2), axis=0))
    friction = FRICTION_STD[:, None] * size
    friction[0] /= limits.velocity
    root = np.diag(np.concatenate([of_links, friction.ravel()]))
    widths = SIGN_WIDTH * limits.velocity

    def jacobian(q: Array, dq: Array, ddq: Array) -> Array:
        links = torque_regressor(chain, *map(np.ascontiguousarray, (q, dq, ddq)))
        own = [_on_diagonal(each) for each in (dq, np.tanh(dq / widths), np.ones_like(dq))]
        return np.concatenate([links, *own], axis=2)

    return Learner(root, NOISE * size, jacobian)


def known_arm(arm: ArmPosterior) -> Learner:
    """Return the posterior of placements, links and friction as what a motion teaches."""
    return Learner(arm.covariance_root, arm.noise.std, arm.jacobian_of_coordinates)


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
        error = ExpectedError(known_arm(arm), self.targets, self.measurements)
        root = error.root_after(self.motion.sample(t))
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
