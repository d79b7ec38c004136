"""Quantities of a recording that the checks need, each computed once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
import math

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, runs
from lip_id_ros.health.clipping import noisy_share
from lip_id_ros.health.effort_regressions import (
    effort_lags,
    effort_regression,
    EffortLags,
    EffortRegression,
    Responses,
    responses,
)
from lip_id_ros.health.motion import (
    motion_of,
    SmoothMotion,
    velocity_agreement,
    VelocityAgreement,
)
from lip_id_ros.joint_types import POSITION_UNITS
from lip_id_ros.preprocessing.continuity import jumps, MOST_VALUES
from lip_id_ros.preprocessing.sample_times import (
    Changes,
    changes_between,
    changes_of,
    repeated,
    source_period,
    source_periods,
    stale,
)
from lip_id_ros.preprocessing.segments import quantum
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.spill import extent, marked, thinned

STILL = 1e-3
"""Joints whose velocity stays below this root mean square [rad/s or m/s] do not move."""

CONSTANT = 1e-5
"""Range of a signal that is constant, over its largest value or 1 [rad/s, N m, A]."""

COARSE_EFFORT = 0.1
"""Step of an effort, in its standard deviations, above which it does not show inertia."""

_TOP_WIDTH = 0.002
_LEAST_TOP = 0.005
_TOP_OVER_NEXT = 5
_LEAST_RUN = 5


@dataclass(frozen=True, eq=False)
class Signal:
    """One signal of one joint, shape (N,), which may lie in a file."""

    values: Array

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Least and largest value, 0 where there is none."""
        least, largest = extent(self.values) if self.values.size else (0.0, 0.0)
        return float(least), float(largest)

    @property
    def range(self) -> float:
        """Largest minus least value."""
        return self.ends[1] - self.ends[0]

    @property
    def is_constant(self) -> bool:
        """Whether it changes by rounding or the noise of a converter at the most."""
        return self.range <= CONSTANT * max(1.0, self.largest)

    @property
    def largest(self) -> float:
        """Largest absolute value."""
        return max(map(abs, self.ends))

    @cached_property
    def step(self) -> float:
        """Step of a quantised signal, 0 where there is none."""
        return quantum(self.values)

    @cached_property
    def coarseness(self) -> float:
        """Return the step in standard deviations, 0 where there is none."""
        return self.step / float(np.std(self.some_values())) if self.step > 0.0 else 0.0

    def some_values(self) -> Array:
        """Return all values, or very many of them at even distances."""
        return thinned(self.values, MOST_VALUES)

    def count_beyond(self, low: float, high: float) -> int:
        """Return how many values are smaller or larger than two limits."""
        return int(marked(lambda values: (values < low) | (values > high), self.values).sum())

    @cached_property
    def clipped_share(self) -> float:
        """
        Share of samples that lie on a flat end of the range.

        A sine that is only quantised has at most two and a half times as many samples on its last
        level as on the one before; a clipped signal has far more.
        """
        low, high = self.ends
        if not self.range > 0.0:
            return 0.0
        width = max(_TOP_WIDTH * self.range, 0.5 * self.step)

        def at_end(distance: float) -> tuple[BoolArray, BoolArray]:
            return (
                marked(lambda values: values >= high - distance, self.values),
                marked(lambda values: values <= low + distance, self.values),
            )

        ends = zip(at_end(width), at_end(3.0 * width), strict=True)
        return max(_flat_end(top, nearby) for top, nearby in ends)

    def longest_plateau(self, t: Array) -> tuple[int, int]:
        """Return first and last row of the longest time that the signal is exactly the same."""
        starts, ends = runs(repeated(self.values[:, np.newaxis])[1:])
        if not starts.size:
            return 0, 0
        longest = int(np.argmax(t[ends] - t[starts]))
        return int(starts[longest]), int(ends[longest])


def _flat_end(top: BoolArray, nearby: BoolArray) -> float:
    count = int(top.sum())
    following = int(nearby.sum()) - count
    starts, ends = runs(top)
    longest_run = int((ends - starts).max(initial=0))
    is_flat = count >= _TOP_OVER_NEXT * (following + 1) and longest_run >= _LEAST_RUN
    share = count / top.size
    return share if is_flat and share >= _LEAST_TOP else 0.0


@dataclass(frozen=True, eq=False)
class Joint:
    """
    One joint of a recording; a figure that is not known is nan, so that no comparison is true.

    `t`, shape (N,) [s]. `signals`: position, and velocity and effort where they were recorded.
    `smooth_velocity`, shape (K,): derivative of the smooth position [rad/s or m/s], K = 0 where
    the recording is too short. `velocity_*` as in `motion.VelocityAgreement`, `effort_explained`
    and `friction_*` as in `EffortRegression`. `effort_period`: samples over which the
    effort of this joint is held while those of others change. `braking`: inertia and friction in
    standard errors, together; negative where the sign is reversed, not known of a coarse effort.
    """

    name: str
    kind: str
    t: Array
    signals: Mapping[str, Signal]
    smooth_velocity: Array
    acceleration: float
    velocity_scale: float = math.nan
    velocity_correlation: float = math.nan
    velocity_lag_s: float = math.nan
    effort_period: int = 1
    effort_explained: float = math.nan
    friction_cosine: float = math.nan
    friction_weight: float = math.nan
    braking: float = math.nan

    @property
    def position(self) -> Signal:
        """The recorded position."""
        return self.signals['position']

    @property
    def reach(self) -> float:
        """Range of the position [rad or m]."""
        return self.position.range

    @cached_property
    def speed(self) -> float:
        """Root mean square velocity [rad/s or m/s]."""
        velocity = self.smooth_velocity
        return float(np.sqrt(np.mean(np.square(velocity)))) if velocity.size else math.nan

    @cached_property
    def clipped_share(self) -> float:
        """Share of the efforts that were clipped, before or after noise was added."""
        effort = self.signals['effort']
        if effort.clipped_share or effort.step:
            return effort.clipped_share
        return noisy_share(effort.some_values(), self.position.some_values())

    @property
    def moves(self) -> bool:
        """Whether the joint moves at all; not where that is unknown."""
        return self.speed > STILL

    @property
    def unit(self) -> str:
        """Unit of the position."""
        return POSITION_UNITS[self.kind]

    def varies(self, signal: str) -> bool:
        """Whether a signal was recorded and is more than a constant with noise of its digits."""
        return signal in self.signals and not self.signals[signal].is_constant


@dataclass(frozen=True, eq=False)
class Evidence:
    """
    A recording and quantities derived from it, each computed at its first use.

    Efforts of `samples` are scaled to torques where the settings give scales, and whole turns of
    positions are undone.
    """

    samples: JointSamples
    joint_types: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the n joints."""
        return self.samples.joint_names

    @cached_property
    def changes(self) -> Changes:
        """Rows at which each signal differs from the row before."""
        return changes_of(self.samples)

    @cached_property
    def is_stale(self) -> BoolArray:
        """Which samples repeat the one before under a new stamp, shape (N,)."""
        return stale(self.samples, self.changes)

    @property
    def stale_share(self) -> float:
        """Share of samples that are stale."""
        return float(self.is_stale.mean()) if self.samples.n_samples else 0.0

    @cached_property
    def source_periods(self) -> dict[str, int]:
        """Samples that each signal takes for a new value, stale ones not counted."""
        return source_periods(changes_between(self.changes, ~self.is_stale))

    @cached_property
    def jumps(self) -> IndexArray:
        """Rows before which a position jumps as no arm moves."""
        new = self.changes['position']
        return jumps(self.samples, new, source_period(new, new))

    @cached_property
    def motion(self) -> SmoothMotion:
        """The smooth motion, in segments without gaps."""
        return motion_of(self.samples)

    @cached_property
    def agreement(self) -> VelocityAgreement | None:
        """Recorded against differentiated velocities, where they can be compared."""
        if not self.samples.has_velocity or not self.motion.segments:
            return None
        return velocity_agreement(self.motion)

    @cached_property
    def explanation(self) -> EffortRegression | None:
        """Efforts against the motion, where they can be compared."""
        if not self.samples.has_effort or not self.motion.segments:
            return None
        return effort_regression(self.motion)

    @cached_property
    def lags(self) -> EffortLags | None:
        """Delays of the efforts: by many terms, or by few of a short recording."""
        if (crude := self.explanation) is None or (fine := effort_lags(self.motion)) is not None:
            return fine if crude is not None else None
        unknown = np.full(len(self.names), math.nan)
        return EffortLags(crude.lag_s, crude.lag_gain, unknown, unknown)

    @cached_property
    def responses(self) -> tuple[Responses, Responses] | None:
        """Responses of efforts to accelerations and to velocities, where they can be judged."""
        if self.explanation is None:
            return None
        return responses(self.motion, self.explanation.lag_s)

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """Signals and figures of each joint."""
        return tuple(self._joint(k, name) for k, name in enumerate(self.names))

    def _joint(self, k: int, name: str) -> Joint:
        samples, motion = self.samples, self.motion
        recorded = {'velocity': samples.has_velocity, 'effort': samples.has_effort}
        names = ['position', *(signal for signal, is_there in recorded.items() if is_there)]
        signals = {signal: Signal(getattr(samples, signal)[:, k]) for signal in names}
        velocity, acceleration = np.empty(0), math.nan
        if motion.segments:
            velocity = motion.joined('velocity')[:, k]
            accelerations = np.abs(motion.joined('acceleration')[:, k])
            acceleration = float(np.percentile(accelerations, 99))
        period = self._effort_period(signals['effort']) if 'effort' in signals else 1
        figures: dict[str, float] = {}
        if (agreement := self.agreement) is not None:
            figures['velocity_scale'] = float(agreement.scale[k])
            figures['velocity_correlation'] = float(agreement.correlation[k])
            figures['velocity_lag_s'] = float(agreement.lag_s[k])
        if (explanation := self.explanation) is not None:
            figures['effort_explained'] = float(explanation.explained[k])
            figures['friction_cosine'] = float(explanation.friction_cosine[k])
            figures['friction_weight'] = float(explanation.friction_weight[k])
        if self.responses is not None and signals['effort'].coarseness < COARSE_EFFORT:
            figures['braking'] = float(sum(each.own[k] for each in self.responses)) / 2.0**0.5
        kind = self.joint_types[k]
        return Joint(
            name, kind, samples.t, signals, velocity, acceleration, effort_period=period, **figures
        )

    def _effort_period(self, effort: Signal) -> int:
        """Return the samples over which one effort is held; 1 where it comes in steps."""
        if effort.step > 0.0 or self.source_periods['effort'] > 1:
            return 1
        new = ~repeated(effort.values[:, np.newaxis]) & ~self.is_stale
        return source_period(new, self.changes['position'])
