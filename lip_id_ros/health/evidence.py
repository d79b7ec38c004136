"""What checks look at: a recording and what is computed from it once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.effort_regression import effort_regression, EffortRegression
from lip_id_ros.health.motion import Agreement, motion_of, SmoothMotion, velocity_agreement
from lip_id_ros.preprocessing.cleaning import quantum, stale
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.spill import release

STILL = 1e-3
"""Joints whose velocity stays below this root mean square [rad/s or m/s] do not move."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """
    A recording and quantities derived from it, each computed at its first use.

    Attributes
    ----------
    samples : JointSamples
        As recorded, efforts scaled to torques where the settings give scales.
    joint_types : tuple of str
        'revolute' or 'prismatic'.

    """

    samples: JointSamples
    joint_types: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the n joints."""
        return self.samples.joint_names

    @cached_property
    def stale_share(self) -> float:
        """Share of samples that repeat the one before under a new stamp."""
        return float(stale(self.samples).mean()) if self.samples.n_samples else 0.0

    @cached_property
    def motion(self) -> SmoothMotion:
        """The smooth motion, in stretches without gaps."""
        return motion_of(self.samples)

    @cached_property
    def speed(self) -> Array:
        """Root mean square velocity of each joint [rad/s or m/s], nan if too short."""
        if not self.motion.stretches:
            return np.full(self.samples.n_joints, np.nan)
        rms: Array = np.sqrt(np.mean(np.square(self.motion.joined('velocity')), axis=0))
        return rms

    @cached_property
    def acceleration(self) -> Array:
        """Absolute acceleration of each joint that a hundredth of the samples exceeds."""
        if not self.motion.stretches:
            return np.full(self.samples.n_joints, np.nan)
        high: Array = np.percentile(np.abs(self.motion.joined('acceleration')), 99, axis=0)
        return high

    @cached_property
    def reach(self) -> Array:
        """Range of each position [rad or m]."""
        if self.samples.n_samples == 0:
            return np.zeros(self.samples.n_joints)
        return np.array([float(np.ptp(values)) for _, _, values in self.columns('position')])

    @cached_property
    def agreement(self) -> Agreement | None:
        """Recorded against differentiated velocities, where they can be compared."""
        if not self.samples.has_velocity or not self.motion.stretches:
            return None
        return velocity_agreement(self.motion)

    @cached_property
    def explanation(self) -> EffortRegression | None:
        """Efforts against the motion, where they can be compared."""
        if not self.samples.has_effort or not self.motion.stretches:
            return None
        return effort_regression(self.motion)

    @cached_property
    def quanta(self) -> dict[str, list[float]]:
        """Step of each joint's position, velocity and effort, 0 where not quantised."""
        signals = {
            'position': True,
            'velocity': self.samples.has_velocity,
            'effort': self.samples.has_effort,
        }
        return {
            signal: [quantum(values) for _, _, values in self.columns(signal)]
            for signal, is_recorded in signals.items()
            if is_recorded
        }

    @cached_property
    def varies(self) -> dict[str, list[bool]]:
        """Whether each joint's velocity and effort take more than one value."""
        return {
            signal: [bool(np.ptp(values) > 0.0) for _, _, values in self.columns(signal)]
            for signal in ('velocity', 'effort')
            if self.samples.n_samples
        }

    def columns(self, signal: str) -> Iterator[tuple[int, str, Array]]:
        """Yield number, name and values of each joint, which may lie in a file."""
        for joint, name in enumerate(self.names):
            values = getattr(self.samples, signal)[:, joint]
            yield joint, name, values
            release(values)

    def moves(self, joint: int) -> bool:
        """Whether a joint moves at all."""
        return bool(self.speed[joint] > STILL)
