"""Plans, and the motion between their points as a joint_trajectory_controller interpolates it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.errors import DataError, missing_joints
from lip_id_ros.signals.joints import increasing_times, PlannedPoint, Refusal, RefusedError

MOST_SAMPLES = 50_000
"""A plan is to be sampled a few times a second: steps are longer where it takes over 250 s."""

LEAST_STEPS = 4
"""
Of a segment, however short: accelerations of degree 3 from rest to rest are zero at both ends, and
largest near a quarter and three quarters.
"""

BEFORE_END = 1.0 - 1e-6
"""Share of a segment at which its end is sampled: its accelerations, not those of the next."""


Torques = Callable[[Array, Array, Array, Array], Array]
"""Torques (N, n) of positions, velocities, accelerations (N, n) at times (N,) [s]."""


class Motion(NamedTuple):
    """Times (N,) [s]; positions, velocities and accelerations (3, N, n)."""

    t: Array
    states: Array

    def at(self, rows: IndexArray) -> Motion:
        """Return the motion at some of its times."""
        return Motion(self.t[rows], self.states[:, rows])

    def slowed(self, scale: float) -> Motion:
        """Return the motion on the same way in `scale` times the time."""
        powers = scale ** np.arange(3.0)
        return Motion(scale * self.t, self.states / powers[:, np.newaxis, np.newaxis])


@dataclass(frozen=True, eq=False)
class Plan:
    """
    Points of a plan.

    `joint_names`: of its columns. `t`, shape (N,): when points are reached [s]. `states`, shape
    (3, N, n): positions, velocities, accelerations; nan where a point has none.

    DataError if times do not increase from 0 or later, a number is not finite, or a point has
    accelerations without velocities, which no controller interpolates.

    """

    joint_names: tuple[str, ...]
    t: Array
    states: Array

    def __post_init__(self) -> None:
        """Check times and numbers."""
        if not len(self.t):
            raise DataError('a plan needs at least one point, this one has none; send a motion.')
        if not (self.t[0] >= 0.0 and (np.diff(self.t) > 0.0).all() and np.isfinite(self.t).all()):
            raise DataError(
                'the times of a plan must begin at 0 or later and increase from point to point; '
                'correct time_from_start.'
            )
        if np.isinf(self.states).any() or np.isnan(self.states[0]).any():
            raise DataError(
                'every point of a plan needs a finite position of each joint; correct the points.'
            )
        given = ~np.isnan(self.states[1:]).any(axis=-1)
        if (given[1] & ~given[0]).any():
            raise DataError(
                'a point of a plan with accelerations needs velocities too; add them, or leave '
                'out the accelerations.'
            )

    @property
    def caution(self) -> str:
        """What its torques lack, as a sentence; empty where nothing is missing."""
        n_points = int(np.isnan(self.states[1]).any(axis=-1).sum())
        if len(self.t) == 1 or not n_points:
            return ''
        return (
            f'{n_points} of {len(self.t)} points have no velocities, so that the motion has '
            'corners: torques of inertia are missing, and friction is that of straight lines; '
            'time the plan where it is made.'
        )

    def slowed(self, scale: float) -> Plan:
        """Return the plan on the same way in `scale` times the time."""
        return Plan(self.joint_names, *Motion(self.t, self.states).slowed(scale))

    def in_order(self, joint_names: Sequence[str]) -> Plan:
        """Return the plan of these joints in their order; DataError if one is missing."""
        if missing := [name for name in joint_names if name not in self.joint_names]:
            raise DataError(missing_joints(missing, 'the plan', self.joint_names, 'plan'))
        columns = [self.joint_names.index(name) for name in joint_names]
        return Plan(tuple(joint_names), self.t, self.states[:, :, columns])

    def begun_at(self, position: Array, early_s: float) -> Plan:
        """Return the plan with points at time 0, at rest at a position (n,), and at `early_s`."""
        here = np.full((3, 1, len(position)), np.nan)
        here[0], here[1] = position, 0.0
        states = np.concatenate([here, self.states], axis=1)
        whole = Plan(self.joint_names, np.append(0.0, self.t), states)
        early = _evaluated(whole._coefficients()[:, :1], np.array([early_s]))
        early[2 - np.isnan(self.states[1, 0]).any() :] = np.nan
        states = np.concatenate([here, early, self.states], axis=1)
        return Plan(self.joint_names, np.concatenate([[0.0, early_s], self.t]), states)

    def motion(self, step_s: float) -> Motion:
        """Sample what is executed at `even_times`."""
        if len(self.t) == 1:
            return Motion(self.t, np.nan_to_num(self.states))
        return self.motion_at(*self.even_times(step_s))

    def even_times(
        self, step_s: float, most: int = MOST_SAMPLES, least: int | IndexArray = LEAST_STEPS
    ) -> tuple[IndexArray, Array]:
        """
        Return the segments of samples, and their times within these [s], both ends among them.

        Steps are `step_s` or less; longer where there would be more than `most`, and shorter where
        a segment would have fewer than the `least`.

        """
        seconds = np.diff(self.t)
        step_s = max(step_s, (self.t[-1] - self.t[0]) / most)
        steps = np.maximum(least, np.ceil(seconds / step_s)).astype(np.intp)
        segment = np.repeat(np.arange(len(steps)), steps + 1)
        first = np.cumsum(steps + 1) - (steps + 1)
        share = (np.arange(len(segment)) - first[segment]) / steps[segment]
        return segment, np.minimum(share, BEFORE_END) * seconds[segment]

    def motion_at(self, segment: IndexArray, within: Array) -> Motion:
        """Return what is executed in segments (M,) at times (M,) since their begin [s]."""
        states = _evaluated(self._coefficients()[:, segment], within)
        return Motion(self.t[segment] + within, states)

    def _coefficients(self) -> Array:
        """
        Return those of the powers of time since the begin of each segment, (6, N - 1, n).

        As in trajectory.cpp of ros2_controllers: of degree 5 between points with velocities and
        accelerations, 3 with velocities, 1 without.

        """
        (q, dq, ddq), seconds = self.states, np.diff(self.t)[:, np.newaxis]
        way = np.diff(q, axis=0)
        v0, v1, a0, a1 = dq[:-1], dq[1:], ddq[:-1], ddq[1:]
        linear, cubic, quintic = np.zeros((3, 6, *way.shape))
        linear[:2] = q[:-1], way / seconds
        cubic[:4] = q[:-1], v0, *_cubic(way, v0, v1, seconds)
        quintic[:3] = q[:-1], v0, 0.5 * a0
        quintic[3:] = _quintic(way, v0, v1, a0, a1, seconds)
        no_velocity = np.isnan(v0 + v1).any(axis=-1, keepdims=True)
        no_acceleration = np.isnan(a0 + a1).any(axis=-1, keepdims=True)
        curved = np.where(no_acceleration, cubic, quintic)
        return np.asarray(np.where(no_velocity, linear, curved))


def plan_of_points(names: Sequence[str], points: Sequence[PlannedPoint]) -> Plan:
    """
    Return the plan of a message of named joints.

    RefusedError if no joint is named, or one twice, there is no point, times do not increase, an
    array is short, long or not finite, or a point lacks positions, or velocities beside
    accelerations.
    """
    if not names:
        raise RefusedError(Refusal.MISSING_JOINT)
    if len(set(names)) != len(names):
        raise RefusedError(Refusal.REPEATED_NAME)
    if not points:
        raise RefusedError(Refusal.NO_POINTS)
    states = np.full((3, len(points), len(names)), np.nan)
    for row, point in enumerate(points):
        given = [point.positions, point.velocities, point.accelerations]
        while len(given) > 1 and not len(given[-1]):
            given.pop()
        for kind, values in enumerate(given):
            if len(values) != len(names):
                raise RefusedError(Refusal.WRONG_PLAN)
            states[kind, row] = values
        if not np.isfinite(states[: len(given), row]).all():
            raise RefusedError(Refusal.NOT_FINITE)
    return Plan(tuple(names), increasing_times(points), states)


def completed(plan: Plan, joint_names: Sequence[str], here: Array | None) -> Plan:
    """
    Return a plan of all these joints in their order: those that it leaves out hold still.

    `here`, shape (2, n): where the joints are, and their velocities. RefusedError if a joint is
    left out of whom that is not known.
    """
    left_out = [row for row, name in enumerate(joint_names) if name not in plan.joint_names]
    if left_out and here is None:
        raise RefusedError(Refusal.MISSING_JOINT)
    states = np.full((3, len(plan.t), len(joint_names)), np.nan)
    for row, name in enumerate(joint_names):
        if row not in left_out:
            states[:, :, row] = plan.states[:, :, plan.joint_names.index(name)]
    if here is not None:
        states[0][:, left_out] = here[0, left_out]
        states[1:, :, left_out] = np.where(np.isnan(plan.states[1:, :, :1]), np.nan, 0.0)
    return Plan(tuple(joint_names), plan.t, states)


def _cubic(way: Array, v0: Array, v1: Array, seconds: Array) -> tuple[Array, Array]:
    return (
        (3.0 * way - (2.0 * v0 + v1) * seconds) / seconds**2,
        (-2.0 * way + (v0 + v1) * seconds) / seconds**3,
    )


def _quintic(
    way: Array, v0: Array, v1: Array, a0: Array, a1: Array, seconds: Array
) -> tuple[Array, Array, Array]:
    square = seconds**2
    return (
        (20.0 * way - (12.0 * v0 + 8.0 * v1) * seconds - (3.0 * a0 - a1) * square)
        / (2.0 * seconds**3),
        (-30.0 * way + (16.0 * v0 + 14.0 * v1) * seconds + (3.0 * a0 - 2.0 * a1) * square)
        / (2.0 * seconds**4),
        (12.0 * way - 6.0 * (v0 + v1) * seconds - (a0 - a1) * square) / (2.0 * seconds**5),
    )


def _evaluated(coefficients: Array, within: Array) -> Array:
    """Evaluate polynomials (6, M, n) and their derivatives at times (M,); shape (3, M, n)."""
    states = np.zeros((3, *coefficients.shape[1:]))
    t = within[:, np.newaxis]
    for coefficient in coefficients[::-1]:  # Horner
        states[2] = states[2] * t + 2.0 * states[1]
        states[1] = states[1] * t + states[0]
        states[0] = states[0] * t + coefficient
    return states
