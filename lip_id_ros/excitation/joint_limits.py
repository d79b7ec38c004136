"""Limits of the joints of an arm, from settings and a URDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.description.limits import joint_ranges, JointRanges
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.settings import MotionSettings, TargetSettings

SECONDS_TO_FULL_VELOCITY = 0.25
SECONDS_TO_FULL_ACCELERATION = 0.1
"""What limits of acceleration and jerk follow from, where none is given."""

LEAST_WAY = 1e-3
"""From the posture to each limit of position, in the range: less leaves no motion."""


@dataclass(frozen=True, eq=False)
class JointLimits:
    """
    Limits of a motion, each (n,); ConfigError, with joint and limit, where one leaves no motion.

    `lower`, `upper`: positions [rad or m]. `velocity`, `acceleration`, `jerk`: largest absolute
    values, per s, s^2 and s^3. `torque`: of predicted torques [N m or N]; None for no limit.
    """

    joint_names: tuple[str, ...]
    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array | None = None
    section: str = 'motion'  # of the settings that they are from

    def __post_init__(self) -> None:
        for name, low, high in zip(self.joint_names, self.lower, self.upper, strict=True):
            if not low < high:
                raise ConfigError(
                    f'joint {name!r} needs a range of positions, but its lower limit is {low:g} '
                    f'and its upper limit {high:g}; correct {self.section}.lower and '
                    f'{self.section}.upper.'
                )
        for what in ('velocity', 'acceleration', 'jerk', 'torque'):
            values = getattr(self, what)
            if values is not None and not np.all(values > 0.0):
                worst = int(np.argmin(values))
                raise ConfigError(
                    f'the {what} of joint {self.joint_names[worst]!r} needs a limit above 0, but '
                    f'it is {values[worst]:g}; correct it in the settings, section '
                    f'{self.section}.'
                )

    @property
    def derivatives(self) -> tuple[Array, Array, Array]:
        """Largest velocities, accelerations and jerks."""
        return self.velocity, self.acceleration, self.jerk

    def leave_motion(self, posture: Array) -> BoolArray:
        """Return which joints (n,) are between their limits of position, and not at one."""
        way = np.minimum(posture - self.lower, self.upper - posture)
        return np.asarray(way > LEAST_WAY * (self.upper - self.lower))

    def require_posture(self, posture: Array) -> None:
        """Refuse a posture that is not between the limits of position, by a ConfigError."""
        leave = self.leave_motion(posture)
        for name, q, low, high, left in zip(
            self.joint_names, posture, self.lower, self.upper, leave, strict=True
        ):
            if not left:
                raise ConfigError(
                    f'the posture of joint {name!r} must be between its position limits '
                    f'{low:g} and {high:g}, and {LEAST_WAY * (high - low):.2g} from each, but is '
                    f'{q:g}; move it, or widen motion.lower and motion.upper.'
                )


def limits_from(
    settings: MotionSettings,
    joint_names: Sequence[str],
    description: tuple[str, str] | None = None,
) -> JointLimits:
    """
    Return the limits of settings, and where they have none a share of those of a URDF.

    `description`: its text, and where it comes from. ConfigError if a limit is in neither, or
    there are too many or too few numbers; DataError if the URDF is none or lacks a joint.
    """
    n, share = len(joint_names), settings.share
    ranges = None if description is None else joint_ranges(*description, joint_names)
    middle, half = _range(ranges, n)
    velocity = _given(settings, 'velocity', n, share * _of(ranges, 'velocity', n))
    acceleration = _given(settings, 'acceleration', n, velocity / SECONDS_TO_FULL_VELOCITY)
    torque = share * _of(ranges, 'effort', n)
    if settings.torque_limits or not np.isnan(torque).any():
        torque = _given(settings, 'torque_limits', n, torque)
    return JointLimits(
        tuple(joint_names),
        lower=_given(settings, 'lower', n, middle - share * half),
        upper=_given(settings, 'upper', n, middle + share * half),
        velocity=velocity,
        acceleration=acceleration,
        jerk=_given(settings, 'jerk', n, acceleration / SECONDS_TO_FULL_ACCELERATION),
        torque=None if np.isnan(torque).any() else torque,
    )


def target_limits(settings: TargetSettings, limits: JointLimits) -> JointLimits:
    """Return the box of states that torques are wanted in; without a jerk limit of its own."""
    n = len(limits.joint_names)
    acceleration = _given(settings, 'acceleration', n, limits.acceleration)
    return replace(
        limits,
        lower=_given(settings, 'lower', n, limits.lower),
        upper=_given(settings, 'upper', n, limits.upper),
        velocity=_given(settings, 'velocity', n, limits.velocity),
        acceleration=acceleration,
        jerk=np.maximum(limits.jerk, acceleration / SECONDS_TO_FULL_ACCELERATION),
        section='targets',
    )


def posture_from(settings: MotionSettings, limits: JointLimits) -> Array:
    """Return the posture of the settings, or the middle of the ranges, shape (n,)."""
    middle = 0.5 * (limits.lower + limits.upper)
    posture = _given(settings, 'posture', len(middle), middle)
    limits.require_posture(posture)
    return posture


def _range(ranges: JointRanges | None, n: int) -> tuple[Array, Array]:
    low, high = _of(ranges, 'lower', n), _of(ranges, 'upper', n)
    return 0.5 * (low + high), 0.5 * (high - low)


def _of(ranges: JointRanges | None, field: str, n: int) -> Array:
    return np.full(n, np.nan) if ranges is None else np.array(getattr(ranges, field))


def _given(
    settings: MotionSettings | TargetSettings, field: str, n: int, otherwise: Array
) -> Array:
    values = getattr(settings, field)
    section = 'motion' if isinstance(settings, MotionSettings) else 'targets'
    if len(values) not in (0, 1, n):
        raise ConfigError(
            f'{section}.{field} needs one number, or one for each of {n} joints, but has '
            f'{len(values)}; correct it.'
        )
    found = np.broadcast_to(np.array(values), n).copy() if values else otherwise
    if np.isnan(found).any():
        raise ConfigError(
            f'{section}.{field} is needed, because no URDF has that limit of every joint; give it '
            'in the settings, or give a URDF that has it.'
        )
    return np.asarray(found, dtype=np.float64)
