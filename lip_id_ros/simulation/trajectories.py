"""Exciting sums of sinusoids, whose derivatives are known exactly."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError, ShapeError


@dataclass(frozen=True)
class MotionLimits:
    """
    Bounds of positions, velocities and accelerations that a trajectory respects, each (n,).

    ShapeError if the four bounds differ in length, DataError if a range is empty.
    """

    q_min: Array
    q_max: Array
    dq_max: Array
    ddq_max: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, _frozen(getattr(self, field.name)))
        shapes = {getattr(self, field.name).shape for field in fields(self)}
        if len(shapes) != 1 or len(next(iter(shapes))) != 1:
            raise ShapeError(
                f'motion limits must have one number per joint each, not shapes {sorted(shapes)}.'
            )
        empty = (self.q_min >= self.q_max) | (self.dq_max <= 0) | (self.ddq_max <= 0)
        if np.any(empty):
            raise DataError(
                f'motion limits leave joint {int(np.argmax(empty)) + 1} no room to move; '
                'widen its range of position, velocity or acceleration.'
            )

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.q_min)

    @property
    def centre(self) -> Array:
        """Middle of the position range [rad or m], shape (n,)."""
        return (self.q_min + self.q_max) / 2

    def first(self, n_joints: int) -> MotionLimits:
        """Keep the limits of the first `n_joints` joints."""
        return MotionLimits(*(getattr(self, field.name)[:n_joints] for field in fields(self)))


def _frozen(values: ArrayLike) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


N_SINUSOIDS = 50
FUNDAMENTAL_HZ = 0.02
GRID_POINTS_PER_FASTEST_PERIOD = 200
HEADROOM = 0.999  # the extremes are found on a grid, which may miss them by 1e-4

JointMotion = tuple[Array, Array, Array]


class Trajectory(Protocol):
    """A motion that is known at any time."""

    def sample(self, t: Array) -> JointMotion:
        """Positions, velocities and accelerations, each (N, n), at times (N,) [s]."""


@dataclass(frozen=True)
class SinusoidTrajectory:
    r"""
    The paper's exciting trajectory (eq. trajectories_gen) around a centre.

    .. math:: q_i(t) = \bar q_i + \sum_l \frac{a_{il}}{\omega l} \sin(\omega l t)
              - \frac{b_{il}}{\omega l} \cos(\omega l t)

    `centre`, shape (n,): positions [rad or m] around which the joints move. `a`, `b`, shape (n,
    L): velocity amplitudes [rad/s or m/s] of the L sinusoids. `fundamental_hz`: lowest frequency;
    the motion repeats after its inverse.
    """

    centre: Array
    a: Array
    b: Array
    fundamental_hz: float = FUNDAMENTAL_HZ

    @classmethod
    def random(
        cls,
        limits: MotionLimits,
        rng: np.random.Generator,
        n_sinusoids: int = N_SINUSOIDS,
        fundamental_hz: float = FUNDAMENTAL_HZ,
    ) -> SinusoidTrajectory:
        """
        Draw amplitudes uniformly from [-c, c], c the largest that respects a joint's limits.

        There are `n_sinusoids` multiples of the fundamental [Hz]. The paper prints 0.02 rad/s,
        with which its 500 samples at 10 Hz would hold a sixth of a period; with 0.02 Hz they are
        exactly one.
        """
        a, b = rng.uniform(-1.0, 1.0, (2, limits.n_joints, n_sinusoids))
        unscaled = cls(np.zeros(limits.n_joints), a, b, fundamental_hz)
        c = unscaled._largest_scale(limits)[:, np.newaxis]
        return cls(limits.centre, c * a, c * b, fundamental_hz)

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.centre)

    @property
    def period(self) -> float:
        """Time [s] after which the motion repeats."""
        return 1.0 / self.fundamental_hz

    def sample(self, t: Array) -> JointMotion:
        """Return q, dq and ddq at times (N,) [s], each (N, n)."""
        omega = 2 * np.pi * self.fundamental_hz * np.arange(1, self.a.shape[1] + 1)
        angle = np.multiply.outer(np.asarray(t, dtype=np.float64), omega)
        sin, cos = np.sin(angle), np.cos(angle)
        q = self.centre + sin @ (self.a / omega).T - cos @ (self.b / omega).T
        dq = cos @ self.a.T + sin @ self.b.T
        ddq = -sin @ (self.a * omega).T + cos @ (self.b * omega).T
        return q, dq, ddq

    def _largest_scale(self, limits: MotionLimits) -> Array:
        n_points = GRID_POINTS_PER_FASTEST_PERIOD * self.a.shape[1]
        q, dq, ddq = self.sample(np.linspace(0.0, self.period, n_points, endpoint=False))
        reach = (limits.q_max - limits.q_min) / 2
        bounds = np.array([reach, limits.dq_max, limits.ddq_max])
        peaks = np.array([np.abs(values).max(axis=0) for values in (q, dq, ddq)])
        return HEADROOM * np.min(bounds / peaks, axis=0)
