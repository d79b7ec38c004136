"""Motions one after the other: how large the next one is, and when one that runs must stop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
import os
from pathlib import Path
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.description.urdf import urdf_text
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.constraints import next_size
from lip_id_ros.excitation.joint_limits import limits_from, posture_from
from lip_id_ros.excitation.planning import (
    config_of,
    design_motion,
    ExcitingMotion,
    joints_of,
    of_model,
)
from lip_id_ros.excitation.settings import ExcitationConfig
from lip_id_ros.excitation.trajectory_file import Trajectory
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.proof import missing_proof
from lip_id_ros.progress import Progress, silent

Urdf = tuple[str, str]
"""Text, and where it comes from."""


@dataclass(frozen=True)
class MotionRequest:
    """
    What the next motion follows.

    `config_path`: settings; empty for the usual ones. `description`: text of a URDF; empty for
    none. `model_path`: what is known; empty for nothing. `last_size`: of the motion before; 0 for
    the first one. `first_size`: of the first one where nothing is known. `positions`: of the
    joints by name, the posture where the settings have none. `report_path`: folder of a page that
    shows the motion; empty for none.
    """

    config_path: str
    description: str
    model_path: str
    last_size: float
    first_size: float
    positions: Mapping[str, float] = field(default_factory=dict)
    report_path: str = ''


@dataclass(frozen=True)
class NextMotion:
    """
    A motion that is designed: its size, its states over time, and what is not known before it.

    `sentences`: how far and how fast it goes, and what nobody has checked.
    `deviation_percent`: standard deviations of torques of motions within all limits, in percent of
    their root mean squares, per joint; empty where there is no model.
    """

    size: float
    trajectory: Trajectory
    deviation_percent: tuple[float, ...]
    sentences: tuple[str, ...] = ()

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> NextMotion:
        """Return what `to_json` was made of."""
        names, *states = content['trajectory']
        trajectory = Trajectory(tuple(names), *map(np.array, states))
        deviations, sentences = (tuple(content[x]) for x in ('deviation_percent', 'sentences'))
        return cls(content['size'], trajectory, deviations, sentences)

    def to_json(self) -> dict[str, Any]:
        """Return values for JSON."""
        names, *states = self.trajectory
        lists = [list(names), *(each.tolist() for each in states)]
        return {**asdict(self), 'trajectory': lists}


def next_motion(
    request: MotionRequest, progress: Progress = silent
) -> tuple[NextMotion, ExcitingMotion]:
    """
    Design the next motion.

    It is as large as the model vouches for, at most twice the last one and `motion.size` of the
    settings, and no larger than the last after a model that is not proven. Raises what
    `design_motion` does, and ConfigError if a joint has no position.
    """
    model = InverseDynamicsModel.load(request.model_path) if request.model_path else None
    config = config_of(request.config_path or None)
    if model is not None:
        config = of_model(config, model)
    urdf = urdf_text(request.description) if request.description else None
    config = _at_present(config, urdf, request.positions)
    config = replace(
        config, motion=replace(config.motion, size=_size(request, config, urdf, model))
    )
    found = design_motion(config, urdf and urdf[0], model, progress=progress)
    size = config.motion.size
    return NextMotion(size, found.trajectory, _deviation_percent(found), found.sentences), found


def _at_present(
    config: ExcitationConfig, urdf: Urdf | None, positions: Mapping[str, float]
) -> ExcitationConfig:
    """Return settings whose posture is where the arm is, unless they have one."""
    if config.motion.posture:
        return config
    names, _, _ = joints_of(config.motion, urdf)
    if missing := [name for name in names if name not in positions]:
        raise ConfigError(
            f'joint_states must have the positions of {", ".join(names)}, but lacks '
            f'{", ".join(missing)}; correct motion.joints or the topic.'
        )
    posture = tuple(positions[name] for name in names)
    return replace(config, motion=replace(config.motion, posture=posture))


def _size(
    request: MotionRequest,
    config: ExcitationConfig,
    urdf: Urdf | None,
    model: InverseDynamicsModel | None,
) -> float:
    motion = config.motion
    if model is None:
        return min(request.first_size, motion.size)
    last = min(request.last_size or request.first_size, motion.size)
    if missing_proof(model) is not None:
        return last
    names, _, _ = joints_of(motion, urdf)
    limits = limits_from(motion, names, urdf)
    posture, series = posture_from(motion, limits), (motion.duration_s, motion.harmonics)
    return next_size(model, limits, posture, last, motion.size, config.search.seed, *series)


def _deviation_percent(found: ExcitingMotion) -> tuple[float, ...]:
    if found.learning is None:
        return ()
    tau = found.learning.before.predict(*found.learning.targets).tau
    usual = np.sqrt(np.mean(tau**2, axis=0))
    return tuple((100.0 * found.learning.torque_std[0] / usual).tolist())


def numbered(path: str, number: int) -> str:
    """Return the path of a motion: its number is added to the name."""
    place = Path(path)
    return os.fspath(place.with_name(f'{place.stem}_{number}{place.suffix}'))


LEAST_LACKING = 0.01
"""Of its way that a joint may lack because it sticks [rad or m], if not half."""

INSTANTS = 5
"""Of the plan, between the earliest and the latest time that a joint state may be of."""


class MotionWatch:
    """
    Judges the joint states while a motion is executed.

    `tracking_tolerance` [rad or m] and `effort_limits`, in the unit of the joint states, have
    shape (n,) in the order of the trajectory's joints.
    """

    def __init__(
        self, planned: Trajectory, tracking_tolerance: Array, effort_limits: Array
    ) -> None:
        self._planned = planned
        self._tolerance, self._limits = tracking_tolerance, effort_limits
        self._lowest, self._highest = np.full((2, len(planned.joint_names)), np.nan)

    @property
    def posture(self) -> Array:
        """Where the motion begins, (n,) [rad or m]."""
        return np.asarray(self._planned.q[0])

    def reason_to_stop(
        self,
        since_start: tuple[float, float],
        q: Sequence[float] | Array,
        effort: Sequence[float] | Array,
    ) -> str | None:
        """
        Return why the motion must stop, or None.

        By positions [rad or m] and efforts, (n,), at a time after its start [s] between two, of
        which nobody knows more; efforts may be empty where they have no limit.
        """
        self._lowest, self._highest = np.fmin(self._lowest, q), np.fmax(self._highest, q)
        times = np.linspace(*since_start, INSTANTS)
        planned = np.array([np.interp(times, self._planned.t, way) for way in self._planned.q.T])
        away = np.maximum(planned.min(axis=1) - q, q - planned.max(axis=1))
        if reason := self._beyond(away, self._tolerance, 'is {:.3g} away from its plan'):
            return reason
        if not len(effort):
            if np.isfinite(self._limits).any():
                return 'the joint states have no effort, which effort_limits are for'
            return None
        return self._beyond(np.abs(np.asarray(effort)), self._limits, 'has an effort of {:.3g}')

    def reason_to_distrust(self) -> str | None:
        """Return which joint stood still within the tolerance while it should move, or None."""
        planned, moved = np.ptp(self._planned.q, axis=0), self._highest - self._lowest
        still = ~(planned - moved <= np.maximum(LEAST_LACKING, 0.5 * planned))
        if not still.any():
            return None
        joint = int(np.argmax(still))
        name = self._planned.joint_names[joint]
        return f'{name} has moved {moved[joint]:.3g} of its {planned[joint]:.3g} in the motion'

    def _beyond(self, values: Array, limits: Array, what: str) -> str | None:
        # a value that is no number is beyond any limit
        beyond = ~(values <= limits)
        if not beyond.any():
            return None
        joint = int(np.argmax(beyond))
        name = self._planned.joint_names[joint]
        return f'{name} {what.format(values[joint])}, beyond {limits[joint]:.3g}'


MOST_KINDS = 100
"""Messages with so many different sets of joints are told apart."""


class Measured:
    """The last positions of joints by name [rad or m], and the times [s] at which they came."""

    def __init__(self, stale_s: float) -> None:
        self._stale_s = stale_s
        self.positions: dict[str, float] = {}
        self._heard_at: dict[str, float] = {}
        self._together: dict[frozenset[str], float] = {}

    def take(self, names: Sequence[str], positions: Iterable[float], now: float) -> None:
        """Take a joint state."""
        self.positions.update(zip(names, positions, strict=True))
        self._heard_at.update(dict.fromkeys(names, now))
        joints = frozenset(names)
        self._together.pop(joints, None)  # the oldest one is the first
        self._together[joints] = now
        while len(self._together) > MOST_KINDS:
            del self._together[next(iter(self._together))]

    def now_at(self, names: Sequence[str], now: float) -> Array | None:
        """Return the positions of joints, shape (n,); None where one is not known now."""
        if any(self._silence(name, now) > self._stale_s for name in names):
            return None
        return np.array([self.positions[name] for name in names])

    def reason_to_wait(
        self, names: Sequence[str], posture: Array, tolerance: Array, now: float
    ) -> str | None:
        """Return why no motion of joints may begin at a posture (n,), or None."""
        return self.reason_not_to_watch(names, now) or self._not_there(names, posture, tolerance)

    def reason_not_to_watch(self, names: Sequence[str], now: float) -> str | None:
        """Return why nobody could watch a motion of joints, or None."""
        for name in names:
            if (silence := self._silence(name, now)) > self._stale_s:
                return f'no joint state of {name} for {silence:.3g} s; start the driver'
        recent = [each for each, at in self._together.items() if now - at <= self._stale_s]
        if any(each.issuperset(names) for each in recent):
            return None
        first = max(recent, key=lambda each: len(each.intersection(names)), default=frozenset())
        lacking = [name for name in names if name not in first]
        return (
            f'no message of joint_states has all joints of the motion: {", ".join(lacking)} and '
            f'{", ".join(name for name in names if name in first)} come in different ones; have '
            'one publisher send all of them, such as one joint_state_broadcaster'
        )

    def _not_there(self, names: Sequence[str], posture: Array, tolerance: Array) -> str | None:
        for name, planned, most in zip(names, posture, tolerance, strict=True):
            away = abs(self.positions.get(name, np.nan) - planned)
            if not away <= most:
                return (
                    f'{name} must be at {planned:.4g} for the motion, within start_tolerance, but '
                    f'is {away:.3g} away; move the arm there'
                )
        return None

    def _silence(self, name: str, now: float) -> float:
        return now - self._heard_at.get(name, -np.inf)
