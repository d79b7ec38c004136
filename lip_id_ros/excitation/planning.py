"""From settings, a robot description and a model to a designed motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
import os
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.description.urdf import moving_joints, parse_description, urdf_text
from lip_id_ros.errors import ConfigError, DataError, ModelError, shortened
from lip_id_ros.excitation.arms import known_arm, Learning
from lip_id_ros.excitation.clearance import Clearance, clearance_of, Extremes
from lip_id_ros.excitation.constraints import Constraint, Constraints, shrunk, TorqueLimits
from lip_id_ros.excitation.design import (
    Criterion,
    Design,
    design,
    first_criterion,
    measurements,
    usual_targets,
)
from lip_id_ros.excitation.expected_error import ExpectedError, States
from lip_id_ros.excitation.joint_limits import (
    JointLimits,
    limits_from,
    posture_from,
    target_limits,
)
from lip_id_ros.excitation.series import FourierMotion, LimitedMotions, peaks
from lip_id_ros.excitation.settings import (
    AS_MOTION,
    ExcitationConfig,
    MotionSettings,
    TargetSettings,
)
from lip_id_ros.excitation.trajectory_file import sampled, Trajectory, writer_for
from lip_id_ros.joint_types import POSITION_UNITS, REVOLUTE
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import read_sections

LEAST_PER_PERIOD = 5.0
"""Points of a motion in the shortest period, between which a controller interpolates."""

MOST_TARGETS = 600
"""States of a data set that a motion is designed for."""

PathLike = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class ExcitingMotion:
    """
    A designed motion with the limits that it keeps.

    `joint_names`, `joint_types`: from base to tip. `design`: the motion, its criterion, and those
    of all that were drawn. `rate`: at which it is written [Hz]. `clearance`: the links and what is
    around them; None where nobody knows them. `unchecked`: a sentence on what nobody has checked,
    empty for nothing. `learning`: what a model will have learned from it; None where there is no
    model.
    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    limits: JointLimits
    design: Design
    rate: float
    clearance: Clearance | None = None
    unchecked: str = ''
    learning: Learning | None = None

    @property
    def motion(self) -> FourierMotion:
        """The motion as a function of time."""
        return self.design.motion

    @property
    def trajectory(self) -> Trajectory:
        """Names, times (N,) [s], and q, dq and ddq, each (N, n)."""
        return sampled(self.motion, self.joint_names, self.rate)

    @property
    def peaks(self) -> Array:
        """Bounds, shape (4, n), of q - posture, dq, ddq and dddq, without signs, at every time."""
        return peaks(self.motion)

    @property
    def position_ends(self) -> Array:
        """Lowest and highest positions, shape (2, n): of samples, to 0.03 % of the way."""
        q = self.motion.derivative(self.motion.fine_times, 0)
        return np.array([q.min(axis=0), q.max(axis=0)])

    @cached_property
    def extremes(self) -> Extremes | None:
        """The lowest and the farthest point of the motion; None where nobody knows the links."""
        return None if self.clearance is None else self.clearance.extremes(self.motion)

    @cached_property
    def sentences(self) -> tuple[str, ...]:
        """The lowest and the farthest point and the fastest joint, and what nobody has checked."""
        speeds = self.peaks[1]
        fastest = int(np.argmax(speeds))
        unit = POSITION_UNITS[self.joint_types[fastest]]
        line = f'Fastest joint: {self.joint_names[fastest]}, {speeds[fastest]:.3g} {unit}/s.'
        if self.extremes is not None:
            (low, height), (far, distance) = self.extremes
            side = 'above' if height >= 0.0 else 'below'
            line = (
                f'Lowest point: {low}, {abs(height):.2f} m {side} the base plane. Farthest point: '
                f'{far}, {distance:.2f} m from the base. {line}'
            )
        return (line, self.unchecked) if self.unchecked else (line,)

    @property
    def gain(self) -> float:
        """Expected squared error of torques, in that of the median draw."""
        return float(np.exp(self.design.criterion - np.median(self.design.drawn)))

    def save(self, path: PathLike) -> None:
        """
        Write a JointTrajectory as .yaml or .mcap, or a table as .csv.

        Raises
        ------
        ConfigError
            If the suffix is another one.
        OSError
            If the file cannot be written.

        """
        writer_for(os.fspath(path))(os.fspath(path), self.trajectory)


def design_motion(
    settings: ExcitationConfig | PathLike | None = None,
    urdf: PathLike | None = None,
    model: InverseDynamicsModel | None = None,
    targets: Dataset | None = None,
    progress: Progress = silent,
) -> ExcitingMotion:
    """
    Design a motion from which an arm is learned well.

    Parameters
    ----------
    settings : ExcitationConfig or path of a YAML file, optional
        Without limits of positions and velocities, those of the URDF are needed.
    urdf : path or text of a URDF, optional
        Its links keep a distance from each other and from the floor.
    model : InverseDynamicsModel, optional
        What is known of the arm already. Its torques stay within limits, where there are any.
    targets : Dataset, optional
        States at which torques will be wanted of the model; without it, those of random motions
        in the box of `settings.targets`, which is that of the limits unless it is given.
    progress : callable
        Called with stage, steps done, and steps in all.

    Returns
    -------
    ExcitingMotion

    Raises
    ------
    ConfigError
        If a setting is wrong, a limit is missing or leaves no motion.
    DataError
        If the URDF is none, or not of this arm; if the targets are not.
    ModelError
        If the model is not one of rigid links.
    OSError, SourceError
        If a file cannot be read.

    """
    config = config_of(settings)
    if targets is not None and config.targets != TargetSettings():
        raise ConfigError(
            'targets are either a recording or the box of the section targets, but both are '
            'given; leave one out.'
        )
    text = None if urdf is None else urdf_text(urdf)
    if model is not None:
        config = of_model(config, model)
    names, types, description = joints_of(config.motion, text)
    if model is not None:
        if description is not None:
            _require_types(types, model.joint_types, description.place)
        types = model.joint_types
    _require_rate(config.motion)
    largest = limits_from(config.motion, names, text)
    clearance, unchecked = clearance_of(config.space, description, largest, model)
    posture = _posture(config, largest, clearance)
    limits = shrunk(largest, posture, config.motion.size)
    constraints = _constraints(clearance, limits, model)
    constraints.require_posture(posture)
    motions = LimitedMotions(limits, posture, config.motion.duration_s, config.motion.harmonics)

    def designed(criterion: Criterion) -> Design:
        return design(motions, criterion, config.search, progress, constraints)

    found = names, types, limits
    rate = config.motion.rate_hz
    if model is None:
        criterion = first_criterion(config, wanted_motions(config, limits, posture), limits, types)
        return ExcitingMotion(*found, designed(criterion), rate, clearance, unchecked)
    assert model.arm is not None, 'models without an arm have been refused'
    states = (
        wanted_states(config, largest, posture) if targets is None else _states(targets, model)
    )
    count = measurements(config, model)
    chosen = designed(ExpectedError(known_arm(model.arm), states, count))
    learning = Learning(model, states, chosen.motion, count)
    return ExcitingMotion(*found, chosen, rate, clearance, unchecked, learning)


def _require_types(types: tuple[str, ...], expected: tuple[str, ...], urdf: str) -> None:
    if types != expected:
        raise DataError(
            f'{urdf} was expected to have joints of the types of the model, '
            f'{", ".join(expected)}, but has {", ".join(types)}: limits in rad would be taken for '
            'm; give the URDF of this arm, or fit again with the types of the joints.'
        )


def _require_rate(settings: MotionSettings) -> None:
    least = LEAST_PER_PERIOD * settings.harmonics / settings.duration_s
    if settings.rate_hz < least:
        raise ConfigError(
            f'motion.rate_hz must be at least {least:g} for a motion of {settings.duration_s:g} s '
            f'with {settings.harmonics} harmonics, but is {settings.rate_hz:g}: between so few '
            'points a controller would move otherwise; raise it, or change the motion.'
        )


def _posture(config: ExcitationConfig, limits: JointLimits, clearance: Clearance | None) -> Array:
    posture = posture_from(config.motion, limits)
    if config.motion.posture or clearance is None:
        return posture
    return clearance.clear_posture(posture, limits)


def wanted_states(config: ExcitationConfig, limits: JointLimits, posture: Array) -> States:
    """Return states of random motions for which torques will be wanted."""
    return usual_targets(config, wanted_motions(config, limits, posture))


def wanted_motions(
    config: ExcitationConfig, limits: JointLimits, posture: Array
) -> LimitedMotions:
    """Return motions in the box of the settings, or within the limits where they have none."""
    box, rate = target_limits(config.targets, limits), config.targets.rate_hz
    start = np.where(box.leave_motion(posture), posture, 0.5 * (box.lower + box.upper))
    period = config.motion.duration_s if rate == AS_MOTION else 1.0 / float(rate)
    return LimitedMotions(box, start, period, config.motion.harmonics)


def _constraints(
    clearance: Clearance | None, limits: JointLimits, model: InverseDynamicsModel | None
) -> Constraints:
    found: list[Constraint] = [] if clearance is None else [clearance]
    if model is not None and limits.torque is not None:
        found.append(TorqueLimits(model, limits))
    return Constraints(found)


def of_model(config: ExcitationConfig, model: Any) -> ExcitationConfig:
    """Return settings with the joints of a model; raise errors where the two do not match."""
    if not isinstance(model, InverseDynamicsModel) or model.arm is None:
        kind = model.kernel if isinstance(model, InverseDynamicsModel) else shortened(model)
        raise ModelError(
            f'a motion is designed for a model of rigid links (articulated), not for {kind}; fit '
            'one, or leave the model out.'
        )
    if config.motion.joints not in ((), model.joint_names):
        raise ConfigError(
            f'motion.joints must be those of the model, {", ".join(model.joint_names)}, but are '
            f'{", ".join(config.motion.joints)}; leave them out.'
        )
    return replace(config, motion=replace(config.motion, joints=model.joint_names))


def _states(targets: Any, model: InverseDynamicsModel) -> States:
    if not isinstance(targets, Dataset):
        raise DataError(
            f'targets of a motion must be a Dataset, not {shortened(targets)}; use load_dataset.'
        )
    chosen = targets.with_joints(model.joint_names)
    rows = np.linspace(0, chosen.n_samples - 1, min(MOST_TARGETS, chosen.n_samples)).astype(int)
    return chosen.q[rows], chosen.dq[rows], chosen.ddq[rows]


def config_of(settings: Any) -> ExcitationConfig:
    """Return settings, those of a YAML file, or the usual ones for None."""
    if settings is None:
        return ExcitationConfig()
    if isinstance(settings, ExcitationConfig):
        return settings
    if isinstance(settings, str | os.PathLike):
        return read_sections(settings, ExcitationConfig())
    raise ConfigError(
        'settings of a motion must be an ExcitationConfig or the path of a YAML file, not '
        f'{shortened(settings)}.'
    )


def joints_of(
    settings: MotionSettings, urdf: tuple[str, str] | None
) -> tuple[tuple[str, ...], tuple[str, ...], RobotDescription | None]:
    """Return names and types of the joints, and the arm of a URDF (text, place), if any."""
    if urdf is None:
        if not settings.joints:
            raise ConfigError(
                'motion.joints must name the joints from base to tip where there is no URDF, but '
                'it is empty; name them, or give a URDF.'
            )
        return settings.joints, (REVOLUTE,) * len(settings.joints), None
    text, place = urdf
    moving = dict(zip(*moving_joints(text, place), strict=True))
    names = settings.joints or tuple(moving)
    types = tuple(moving.get(name, REVOLUTE) for name in names)
    return names, types, parse_description(text, place, names, types)
