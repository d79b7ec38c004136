"""Recordings replayed through the filter: each torque is predicted before it is learned from."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from lip_id_ros.adaptation.adaptation import Adaptation, Followed
from lip_id_ros.adaptation.changes import changes, friction_at_speed
from lip_id_ros.adaptation.followed import WalkSettings
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import Progress, silent

PART_S = 5.0
"""Time after which the friction is noted [s]."""


@dataclass(frozen=True, eq=False)
class ReplayedRecording:
    """
    One recording.

    `t`, shape (N,): time since the start of the first [s]. `tau`, shape (N, n): measured torques.
    `friction`, `std`, shape (C, n): of each joint at a usual speed, with its deviation [N m or N],
    after each part, which ends at `at`, shape (C,) [s].

    """

    t: Array
    tau: Array
    followed: Followed
    at: Array
    friction: Array
    std: Array

    @property
    def frozen_percent(self) -> Array:
        """Error of the fit, nMSE, shape (n,)."""
        return nmse_percent(self.followed.frozen, self.tau)

    @property
    def followed_percent(self) -> Array:
        """Error of the torques that would be served, of each sample before it is learned from."""
        return nmse_percent(self.followed.served, self.tau)

    @property
    def within_two_std_percent(self) -> Array:
        """Share of the measured torques within two deviations, shape (n,)."""
        within = np.abs(self.tau - self.followed.tau) <= 2.0 * self.followed.std
        return np.asarray(100.0 * within.mean(axis=0))

    def to_json(self) -> dict[str, Any]:
        """Return the figures for other programs."""
        return {
            'frozen_nmse_percent': _known(self.frozen_percent),
            'nmse_percent': _known(self.followed_percent),
            'within_two_std_percent': self.within_two_std_percent.tolist(),
            'trusted_percent': float(100.0 * self.followed.trusted.mean()),
            'learned_percent': float(100.0 * self.followed.learned.mean()),
            'seconds': float(self.t[-1] - self.t[0]),
        }


@dataclass(frozen=True, eq=False)
class Replay:
    """Recordings in their order, and the arm as it is after the last."""

    adaptation: Adaptation
    recordings: tuple[ReplayedRecording, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the figures for other programs."""
        return {
            'recordings': [each.to_json() for each in self.recordings],
            'changes': [each.to_json() for each in changes(self.adaptation)],
            'payloads': [each.to_json() for each in self.adaptation.payload_events],
            'forgotten': self.adaptation.n_forgotten,
        }


def replay(
    model: InverseDynamicsModel,
    dataset: Dataset,
    pause_s: float,
    walk: WalkSettings | None = None,
    progress: Progress = silent,
) -> Replay:
    """
    Follow an arm through recordings, in their order.

    `dataset`: with the model's joints in its order. `pause_s`: time between recordings [s].
    ModelError if the model is no arm.

    """
    adaptation, parts, start = Adaptation(model, walk), list[ReplayedRecording](), 0.0
    numbers = np.unique(dataset.recording)
    for done, number in enumerate(numbers):
        progress('adapt', done, len(numbers))
        part = _replayed(adaptation, dataset.select(dataset.recording == number), start)
        start = float(part.t[-1]) + pause_s
        parts.append(part)
    progress('adapt', len(numbers), len(numbers))
    return Replay(adaptation, tuple(parts))


def _replayed(adaptation: Adaptation, data: Dataset, start: float) -> ReplayedRecording:
    t = data.t - data.t[0] + start
    arrays = t, data.q, data.dq, data.ddq, data.tau
    followed, friction = list[Followed](), list[tuple[Array, Array]]()
    ends = np.append(np.flatnonzero(np.diff((t - start) // PART_S)) + 1, t.size)
    for first, last in pairwise([0, *ends.tolist()]):
        followed.append(adaptation.update(*(x[first:last] for x in arrays)))
        friction.append(friction_at_speed(adaptation))
    torque, std = (np.array(each) for each in zip(*friction, strict=True))
    whole = Followed.joined(followed)
    return ReplayedRecording(t, data.tau, whole, t[ends - 1], torque, std)


def _known(values: Array) -> list[float | None]:
    """Return numbers for JSON, None where there is none."""
    return [None if np.isnan(x) else float(x) for x in values]
