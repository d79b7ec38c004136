"""Arms whose torques are one line, for tests of the ways of their torques."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, EVERY, Rows
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.model import EffortCalibration, Prediction, Query, StandardDeviation
from lip_id_ros.model.known_states import KnownStates

NAMES = ('a', 'b')


@dataclass(frozen=True)
class Sum:
    """A robot whose torques are q (gravity) + 10 dq + 100 ddq."""

    factor: float = 1.0
    joint_names: tuple[str, ...] = NAMES
    reach: float = 1e6
    has_potential: bool = True
    dry: float = 0.0  # friction

    @property
    def n_joints(self) -> int:
        return len(self.joint_names)

    @property
    def joint_types(self) -> tuple[str, ...]:
        return ('revolute',) * self.n_joints

    @property
    def size(self) -> int:
        return 1

    @property
    def noise_std(self) -> Array:
        return np.ones(self.n_joints)

    @property
    def training_range(self) -> tuple[Array, Array]:
        box = np.full((3, self.n_joints), self.reach)
        return -box, box

    def efforts(self, torque: Array) -> Array:
        return torque

    def inertia_matrix(self, q: Array) -> Array:
        return np.tile(100 * self.factor * np.eye(self.n_joints), (len(q), 1, 1))

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        parts = self.factor * np.stack([q, 10 * dq, 100 * ddq])
        tau = parts.sum(axis=0) + self.dry * np.sign(dq)
        return Query(tau, float(dq @ dq), np.nan, parts[0])

    def predict(
        self, q: Array, dq: Array, ddq: Array, t: Array | None = None, *, return_std: bool = False
    ) -> Prediction:
        gravity, coriolis, inertial = self.factor * np.stack([q, 10 * dq, 100 * ddq])
        friction = self.dry * np.sign(dq)
        tau = gravity + coriolis + inertial + friction
        return Prediction(tau, (dq * dq).sum(axis=1), None, inertial, coriolis, gravity, friction)

    def standard_deviation(
        self, q: Array, dq: Array, ddq: Array, t: Array | None = None, rows: Rows = EVERY
    ) -> StandardDeviation:
        energy = np.ones(len(q[rows]))
        return StandardDeviation(np.ones_like(q[rows]), np.ones_like(q[rows]), energy, None)


def arm(factor: float = 1.0, reach: float = 1e6) -> LoadedModel:
    """Return an arm that was trained on -reach to reach."""
    model, one = Sum(factor, reach=reach), np.ones(len(NAMES))
    near_zero = KnownStates(np.zeros((1, 3 * len(NAMES))), np.ones(3 * len(NAMES)), 2.0)
    return LoadedModel(model, EffortCalibration(one, 0 * one), near_zero)


def point(q: Sequence[float], dq: Sequence[float], ddq: Sequence[float], t: float = 0.0) -> Any:
    arrays = (array('d', values) for values in (q, dq, ddq))
    fields = dict(zip(('positions', 'velocities', 'accelerations'), arrays, strict=True))
    sec = int(t)
    after = SimpleNamespace(sec=sec, nanosec=round(1e9 * (t - sec)))
    return SimpleNamespace(**fields, time_from_start=after)
