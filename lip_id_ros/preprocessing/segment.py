"""An uninterrupted piece of a recording, with efforts as torques, and its interpolation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import ConfigError, SourceError
from lip_id_ros.preprocessing.sample_times import Changes, supports
from lip_id_ros.preprocessing.smoothing import resample, resample_early
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.spill import mapped, release
from lip_id_ros.settings import RecordingSettings

Value = TypeVar('Value')


@dataclass(frozen=True, eq=False)
class Segment:
    """
    An uninterrupted piece of a recording: N samples of n joints.

    `effort`: torques [N m or N]. `velocity`: None where it was not recorded or is not used.
    `rate_hz`: of the uniform times that the samples are brought to. `delays_s`: how much later
    than positions the efforts of each joint were measured. `supports`: samples between which a
    signal is interpolated, (N,) each (`sample_times.supports`); all of a signal that it does not
    name. `longest_hold`: samples over which a signal may be held.
    """

    t: Array
    position: Array
    velocity: Array | None
    effort: Array
    rate_hz: float
    delays_s: tuple[float, ...]
    supports: Mapping[str, BoolArray]
    longest_hold: int = 1

    @property
    def n_samples(self) -> int:
        """Number of samples N."""
        return int(self.t.size)

    @property
    def duration_s(self) -> float:
        """From the first sample to the last [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def largest_delay_s(self) -> float:
        """The largest delay of an effort, in either direction."""
        return max(map(abs, self.delays_s))

    def rows(self, chosen: slice) -> Segment:
        """Return views of some samples."""
        return replace(
            self,
            t=self.t[chosen],
            position=self.position[chosen],
            velocity=None if self.velocity is None else self.velocity[chosen],
            effort=self.effort[chosen],
            supports={name: rows[chosen] for name, rows in self.supports.items()},
        )

    def uniform(self, times: Array) -> Segment:
        """Interpolate all signals to times within, shape (K,), efforts without their delays."""
        late = self._supported('effort', self.effort)
        return replace(
            self,
            t=times,
            position=resample(*self._supported('position', self.position), times),
            velocity=None
            if self.velocity is None
            else resample(*self._supported('velocity', self.velocity), times),
            effort=resample_early(*late, times, self.delays_s),
            delays_s=(0.0,) * len(self.delays_s),
            supports={},
            longest_hold=1,
        )

    def release(self) -> None:
        """Give the memory of mapped pages back."""
        signals = (self.position, self.velocity, self.effort)
        release(*(signal for signal in signals if signal is not None))

    def _supported(self, name: str, values: Array) -> tuple[Array, Array]:
        if name not in self.supports:
            return self.t, values
        rows = self.supports[name].copy()
        rows[[0, -1]] = True  # nothing is extrapolated
        return self.t[rows], values[rows]


def segment_of(
    fresh: JointSamples,
    rows: slice,
    changes: Changes,
    periods: Mapping[str, int],
    rate_hz: float,
) -> Segment:
    """
    Take rows without a gap out of a recording without stale samples (`fresh`).

    `changes`, `periods`: of `sample_times.without_stale` and `sample_times.source_periods`.
    """
    return Segment(
        fresh.t[rows],
        fresh.position[rows],
        fresh.velocity[rows],
        fresh.effort[rows],
        rate_hz,
        (0.0,) * fresh.n_joints,
        {name: supports(changes[name][rows], k) for name, k in periods.items() if k > 1},
        max(periods.values()),
    )


def torque(samples: JointSamples, recording: RecordingSettings) -> Array:
    """
    Return recorded efforts as torques or forces [N m or N], scaled and offset per joint.

    SourceError if no effort was recorded; ConfigError if a scale is 0, or not given for each
    joint.
    """
    if not samples.has_effort:
        raise SourceError(
            f'{samples.topic or "joint states"} in {samples.source} must have effort, but every '
            'message leaves it empty; record it with a driver that measures torque or current, or '
            'name the topic of its efforts too: recording.topic: /joint_states, /efforts.'
        )
    scale = np.array(per_joint(samples, 'effort_scale', recording.effort_scale, 1.0))
    offset = np.array(per_joint(samples, 'effort_offset', recording.effort_offset, 0.0))
    if not scale.all():
        joint = samples.joint_names[int(np.argmin(scale != 0.0))]
        raise ConfigError(
            f'recording.effort_scale must not be 0, as it is for {joint}: every torque would be; '
            'give 1 where the effort is a torque.'
        )
    if (scale == 1.0).all() and (offset == 0.0).all():
        return samples.effort
    return mapped(lambda effort: effort * scale + offset, samples.effort)


def per_joint(
    samples: JointSamples, name: str, values: tuple[Value, ...], default: Value
) -> tuple[Value, ...]:
    """Return one value for each joint, or the default for all; ConfigError for another number."""
    if not values:
        return (default,) * samples.n_joints
    if len(values) != samples.n_joints:
        raise ConfigError(
            f'recording.{name} must have one value for each of {", ".join(samples.joint_names)}, '
            f'not {len(values)}; give {samples.n_joints}.'
        )
    return values
