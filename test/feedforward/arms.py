"""Arms whose torques are one line, for the tests of what is done with them."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.checks import TrainingRange
from lip_id_ros.feedforward.feedforward import Feedforward
from lip_id_ros.feedforward.loading import Arm
from lip_id_ros.model import Prediction, Query
from lip_id_ros.signals.joint_states import EffortCalibration

NAMES = ('a', 'b')


@dataclass
class Sum:
    """A robot whose torques are q (gravity) + 10 dq + 100 ddq."""

    factor: float = 1.0

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        parts = self.factor * np.stack([q, 10 * dq, 100 * ddq])
        return Query(parts.sum(axis=0), float(dq @ dq), np.nan, parts[0])

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        gravity, coriolis, inertial = self.factor * np.stack([q, 10 * dq, 100 * ddq])
        tau = gravity + coriolis + inertial
        return Prediction(tau, (dq * dq).sum(axis=1), None, inertial, coriolis, gravity, 0 * tau)


def arm(factor: float = 1.0, names: Sequence[str] = NAMES, reach: float = 1e6) -> Arm:
    """Return an arm that was trained on -reach to reach."""
    box = np.full((3, len(names)), reach)
    one = np.ones(len(names))
    return Arm(
        Feedforward(Sum(factor), names), TrainingRange(-box, box), EffortCalibration(one, 0 * one)
    )


def point(q: Sequence[float], dq: Sequence[float], ddq: Sequence[float], t: float = 0.0) -> Any:
    arrays = (array('d', values) for values in (q, dq, ddq))
    fields = dict(zip(('positions', 'velocities', 'accelerations'), arrays, strict=True))
    sec = int(t)
    after = SimpleNamespace(sec=sec, nanosec=round(1e9 * (t - sec)))
    return SimpleNamespace(**fields, time_from_start=after)
