"""What a model will have learned from a motion, by its posterior before the motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.expected_error import ExpectedError, States
from lip_id_ros.excitation.known_arm import KnownArm
from lip_id_ros.excitation.series import FourierMotion
from lip_id_ros.model import InverseDynamicsModel

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
