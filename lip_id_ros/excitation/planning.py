"""From settings and a robot description to a designed motion."""

from __future__ import annotations

from dataclasses import dataclass
import os
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.description.urdf import moving_joints, parse_description, urdf_text
from lip_id_ros.errors import ConfigError, shortened
from lip_id_ros.excitation.design import Design, design
from lip_id_ros.excitation.expected_error import ExpectedError, MeanCriterion
from lip_id_ros.excitation.joint_limits import JointLimits, limits_from, posture_from
from lip_id_ros.excitation.scaling import LimitedMotions, peaks
from lip_id_ros.excitation.series import FourierMotion
from lip_id_ros.excitation.settings import ExcitationConfig, MotionSettings
from lip_id_ros.excitation.targets import random_targets
from lip_id_ros.excitation.trajectory_file import sampled, Trajectory, writer_for
from lip_id_ros.excitation.unknown_arms import unknown_arm
from lip_id_ros.joint_types import REVOLUTE
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import read_sections

ARMS = 4
"""That an unknown arm may be, over which the criterion is averaged."""

INDEPENDENT_HZ = 100.0
"""Rate of independent measurements of torques; noise of drives is seldom white beyond."""

FINE_PER_S = 200.0

LEAST_SAMPLES, SAMPLES_PER_HARMONIC = 120, 24
"""States at which a criterion is evaluated."""

PathLike = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class ExcitingMotion:
    """
    A designed motion with the limits that it keeps.

    `joint_names`, `joint_types`: from base to tip. `design`: the motion, its criterion, and those
    of random motions within the same limits. `rate`: at which it is written [Hz].

    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    limits: JointLimits
    design: Design
    rate: float

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
        """Bounds of |q - posture|, |dq|, |ddq| and |dddq| at every time, shape (4, n)."""
        return peaks(self.motion)

    @property
    def position_ends(self) -> Array:
        """Lowest and highest positions, shape (2, n): of samples, to 0.03 % of the way."""
        q = self.motion.derivative(self.motion.times(FINE_PER_S), 0)
        return np.array([q.min(axis=0), q.max(axis=0)])

    @property
    def gains(self) -> tuple[float, float]:
        """Expected squared error in that of random motions: of their mean, and of the best."""
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
    progress: Progress = silent,
) -> ExcitingMotion:
    """
    Design a first motion: its states are spread over what the limits allow.

    Parameters
    ----------
    settings : ExcitationConfig or path of a YAML file, optional
        Without limits of positions and velocities, those of the URDF are needed.
    urdf : path or text of a URDF, optional
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
        If the URDF is none, or not of this arm.
    OSError, SourceError
        If a file cannot be read.

    """
    config = _config(settings)
    description = None if urdf is None else urdf_text(urdf)
    names, types = _joints(config.motion, description)
    limits = limits_from(config.motion, names, description)
    posture = posture_from(config.motion, limits)
    motions = LimitedMotions(limits, posture, config.motion.duration_s, config.motion.harmonics)
    criterion = _first_criterion(config, motions, limits, types)
    found = design(motions, criterion, config.search, progress)
    return ExcitingMotion(names, types, limits, found, config.motion.rate_hz)


def _first_criterion(
    config: ExcitationConfig,
    motions: LimitedMotions,
    limits: JointLimits,
    types: tuple[str, ...],
) -> MeanCriterion:
    """Return the mean expected error over some arms that this one may be."""
    rng = np.random.default_rng([config.search.seed, 1])
    targets = random_targets(motions, rng)
    measurements = config.motion.duration_s * INDEPENDENT_HZ
    arms = [unknown_arm(limits, types, targets, rng) for _ in range(ARMS)]
    return MeanCriterion(
        [ExpectedError(arm, targets, measurements, _samples(config)) for arm in arms]
    )


def _samples(config: ExcitationConfig) -> int:
    return max(LEAST_SAMPLES, SAMPLES_PER_HARMONIC * config.motion.harmonics)


def _config(settings: Any) -> ExcitationConfig:
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


def _joints(
    settings: MotionSettings, description: tuple[str, str] | None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return names and types of the joints, which must be one serial arm of the URDF."""
    if description is None:
        if not settings.joints:
            raise ConfigError(
                'motion.joints must name the joints from base to tip where there is no URDF, but '
                'it is empty; name them, or give a URDF.'
            )
        return settings.joints, (REVOLUTE,) * len(settings.joints)
    text, place = description
    moving = dict(zip(*moving_joints(text, place), strict=True))
    names = settings.joints or tuple(moving)
    types = tuple(moving.get(name, REVOLUTE) for name in names)
    parse_description(text, place, names, types)
    return names, types
