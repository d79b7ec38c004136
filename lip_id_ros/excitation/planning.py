"""From settings, a robot description and a model to a designed motion."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
import os
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.urdf import moving_joints, parse_description, urdf_text
from lip_id_ros.errors import ConfigError, DataError, ModelError, shortened
from lip_id_ros.excitation.arms import KnownArm, Learning
from lip_id_ros.excitation.constraints import Constraint, Constraints, shrunk, TorqueLimits
from lip_id_ros.excitation.design import (
    Design,
    design,
    first_criterion,
    measurements,
    next_criterion,
    usual_targets,
)
from lip_id_ros.excitation.expected_error import States
from lip_id_ros.excitation.joint_limits import (
    JointLimits,
    limits_from,
    posture_from,
    target_limits,
)
from lip_id_ros.excitation.self_collision import SelfCollision
from lip_id_ros.excitation.series import FourierMotion, LimitedMotions, peaks
from lip_id_ros.excitation.settings import (
    AS_MOTION,
    ExcitationConfig,
    INFORMATION,
    MotionSettings,
    NONE,
    SpaceSettings,
    TargetSettings,
)
from lip_id_ros.excitation.space import is_limited, Space
from lip_id_ros.excitation.trajectory_file import sampled, Trajectory, writer_for
from lip_id_ros.joint_types import REVOLUTE
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import Progress, silent
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.couplings import coupling_matrix
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
    of random motions within the same limits. `rate`: at which it is written [Hz]. `chain`,
    `space`: where the joints are and may be; None without a URDF. `learning`: what a model
    will have learned from it; None where there is no model. `for_information`: whether it is
    designed for information on the parameters.
    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    limits: JointLimits
    design: Design
    rate: float
    chain: Chain | None = None
    space: SpaceSettings = field(default_factory=SpaceSettings)
    learning: Learning | None = None
    for_information: bool = False

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

    def places(self, rate: float) -> Array:
        """Return the ways of the joints but the first, and of the tool, (N, n, 3) [m]."""
        assert self.chain is not None, 'places need a chain'
        q = self.motion.derivative(self.motion.times(rate), 0)
        return Space(self.space, self.chain, self.limits).points(q)[0]

    @property
    def gains(self) -> tuple[float, float]:
        """
        Expected squared error in that of random motions: of their mean, and of the best.

        Where information was asked for: the same of variances of parameters, as geometric means.
        """
        ratios = np.exp(self.design.criterion - self.design.random_criteria)
        return float(1.0 / np.mean(1.0 / ratios)), float(ratios.max())

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
    description = None if urdf is None else urdf_text(urdf)
    if model is not None:
        config = of_model(config, model)
    names, types, chain = joints_of(config.motion, description)
    _require_rate(config.motion)
    largest = limits_from(config.motion, names, description)
    posture = posture_from(config.motion, largest)
    limits = shrunk(largest, posture, config.motion.size)
    motions = LimitedMotions(limits, posture, config.motion.duration_s, config.motion.harmonics)
    apart = _links_apart(config, description, largest, model)
    if model is None:
        constraints = _constraints(config, chain, limits, None, apart)
        constraints.require_posture(posture)
        criterion = first_criterion(config, wanted_motions(config, limits, posture), limits, types)
        found = design(motions, criterion, config.search, progress, constraints)
        return ExcitingMotion(
            names, types, limits, found, config.motion.rate_hz, chain, config.space
        )
    assert model.arm is not None, 'models without an arm have been refused'
    if description is not None:
        _require_types(types, model.joint_types, description[1])
    learner, types = KnownArm(model.arm), model.joint_types
    states = (
        wanted_states(config, largest, posture) if targets is None else _states(targets, model)
    )
    count = measurements(config, model)
    criterion = next_criterion(config, learner, states, count)
    if chain is not None:
        chain = chain._replace(couplings=model.arm.chain.couplings)
    constraints = _constraints(config, chain, limits, model, apart)
    constraints.require_posture(posture)
    found = design(motions, criterion, config.search, progress, constraints)
    learning = Learning(model, states, found.motion, count)
    return ExcitingMotion(
        *(names, types, limits, found, config.motion.rate_hz, chain, config.space, learning),
        for_information=config.search.criterion == INFORMATION,
    )


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
    config: ExcitationConfig,
    chain: Chain | None,
    limits: JointLimits,
    model: InverseDynamicsModel | None,
    apart: list[Constraint],
) -> Constraints:
    found = [*apart]
    if model is not None and limits.torque is not None:
        found.append(TorqueLimits(model, limits))
    if is_limited(config.space):
        if chain is None:
            raise ConfigError(
                'a floor, boxes or space.keep_in need a URDF, but there is none: torques do not '
                'show how high the base is, how it is turned, nor where on its axis a joint is; '
                'give a URDF, or leave them out.'
            )
        found.append(Space(config.space, chain, limits))
    return Constraints(found)


def _links_apart(
    config: ExcitationConfig,
    description: tuple[str, str] | None,
    limits: JointLimits,
    model: InverseDynamicsModel | None,
) -> list[Constraint]:
    if config.space.self_distance_m == NONE:
        return []
    if description is None:
        raise ConfigError(
            'space.self_distance_m needs the shapes of the links, but there is no URDF; give one, '
            'or set it to none.'
        )
    matrix = np.eye(len(limits.joint_names))
    if model is not None and model.arm is not None:
        matrix = coupling_matrix(model.arm.chain)
    return [SelfCollision(description, limits, matrix, float(config.space.self_distance_m))]


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
    settings: MotionSettings, description: tuple[str, str] | None
) -> tuple[tuple[str, ...], tuple[str, ...], Chain | None]:
    """Return names and types of the joints, and the chain where there is a URDF (text, place)."""
    if description is None:
        if not settings.joints:
            raise ConfigError(
                'motion.joints must name the joints from base to tip where there is no URDF, but '
                'it is empty; name them, or give a URDF.'
            )
        return settings.joints, (REVOLUTE,) * len(settings.joints), None
    text, place = description
    moving = dict(zip(*moving_joints(text, place), strict=True))
    names = settings.joints or tuple(moving)
    types = tuple(moving.get(name, REVOLUTE) for name in names)
    return names, types, parse_description(text, place, names, types).chain
