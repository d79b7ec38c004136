"""Recordings of known motions, for tests of preprocessing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.recording import JointSamples


@dataclass(frozen=True)
class Sinusoids:
    """Sums of 20 sinusoids for each of two joints, up to a highest frequency [Hz]."""

    seed: int = 0
    highest_hz: float = 1.0

    def position(self, t: Array) -> Array:
        return self._sum(t, 0)

    def velocity(self, t: Array) -> Array:
        return self._sum(t, 1)

    def acceleration(self, t: Array) -> Array:
        return self._sum(t, 2)

    def torque(self, t: Array) -> Array:
        """Of two pendulums without gravity: what a filter does to it, it does to accelerations."""
        return 2.0 * self.acceleration(t) + 0.5 * self.velocity(t)

    def _sum(self, t: Array, order: int) -> Array:
        rng = np.random.default_rng(self.seed)
        number = np.arange(1, 21)
        rate = 2.0 * np.pi * self.highest_hz * number / 20
        amplitude = rng.normal(size=(2, 20)) / number * rate**order
        phase = rng.uniform(0.0, 2.0 * np.pi, (2, 20)) + order * np.pi / 2
        summed: Array = (amplitude * np.sin(t[:, None, None] * rate + phase)).sum(axis=-1)
        return summed


def uniform(count: int, rate: float) -> Array:
    return np.arange(count, dtype=np.float64) / np.float64(rate)


def recording(t: Array, motion: Sinusoids | None = None, **changes: Any) -> JointSamples:
    motion = motion or Sinusoids()
    fields: dict[str, Any] = {
        't': t,
        'position': motion.position(t),
        'velocity': motion.velocity(t),
        'effort': motion.torque(t),
        'joint_names': ('shoulder', 'elbow'),
        'source': 'arm.mcap',
        'topic': '/joint_states',
    }
    return JointSamples(**(fields | changes))


def relative_error(estimate: Array, truth: Array) -> float:
    return float(np.sqrt(np.mean((estimate - truth) ** 2)) / truth.std())


def dropped(data: Dataset) -> dict[str, int]:
    (source,) = data.provenance['sources']
    return dict(source['dropped'])


def without_velocity(samples: JointSamples) -> JointSamples:
    return replace(samples, velocity=np.full_like(samples.velocity, np.nan))
