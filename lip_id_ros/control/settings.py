"""Parameters of the node `computed_torque`, in the order of its joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.settings import description_setting, executor_setting, setting, Settings
from lip_id_ros.settings.settings import AT_START, PER_JOINT
from lip_id_ros.signals.joints import by_joint, require_unique
from lip_id_ros.signals.torque_steps import (
    DEFAULT_RATE,
    DESCRIBED,
    limits_in_numbers,
    require_limits,
    UNLIMITED,
)


@dataclass(frozen=True)
class Gains:
    """Diagonals of the feedback's matrices, shapes (n,)."""

    stiffness: Array  # K_p [N m/rad or N/m]
    damping: Array  # K_d [N m s/rad or N s/m]

    def feedback(self, q_error: Array, dq_error: Array) -> Array:
        """Torques [N m or N], shape (n,), against errors of position and velocity."""
        return self.stiffness * q_error + self.damping * dq_error


@dataclass(frozen=True)
class ControlSettings(Settings):
    """The node `computed_torque`."""

    joints: tuple[str, ...] = setting(
        (), 'Joints to control, in the order of the gains.', applies=AT_START
    )
    stiffness: tuple[float, ...] = setting(
        (),
        'Torque per position error, per joint.',
        unit='N m/rad or N/m',
        minimum=0.0,
        applies=AT_START,
    )
    damping: tuple[float, ...] = setting(
        (),
        'Torque per velocity error, per joint.',
        unit='N m s/rad or N s/m',
        minimum=0.0,
        applies=AT_START,
    )
    torque_limits: tuple[float, ...] | str = setting(
        (),
        'Largest torque or force; must be given: the word none for no limits, robot_description '
        f'for those of the URDF. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
        choices=(UNLIMITED, DESCRIBED),
        applies=AT_START,
    )
    robot_description: str = description_setting()
    rate_limits: tuple[float, ...] = setting(
        (),
        'Largest change of a torque or force; empty: twenty times torque_limits per second, and '
        f'no bound where those are none. {PER_JOINT}',
        unit='N m/s or N/s',
        minimum=0.0,
        applies=AT_START,
    )
    ramp_s: float = setting(
        0.05,
        'Time in which a plan takes over from the torques before. An arm without brakes or '
        'gravity compensation sags meanwhile.',
        unit='s',
        minimum=0.0,
        maximum=60.0,
        applies=AT_START,
    )
    safe_ramp_s: float = setting(
        0.02,
        'Time in which torques go to zero once the plan is let go; rate_limits hold as well.',
        unit='s',
        minimum=0.0,
        maximum=1.0,
        applies=AT_START,
    )
    stale_timeout_s: float = setting(
        0.05,
        'Longest silence of the joint states before the plan is let go. A stamp that is further '
        'ahead than this, beyond the time since the message before, is not believed.',
        unit='s',
        minimum=0.001,
        maximum=60.0,
        applies=AT_START,
    )
    start_tolerance: tuple[float, ...] = setting(
        (0.1,),
        f'Longest way from the arm to the beginning of a plan. {PER_JOINT}',
        unit='rad or m',
        minimum=0.0,
        applies=AT_START,
    )
    path_tolerance: tuple[float, ...] = setting(
        (0.2,),
        f'Longest way from the arm to the plan before the plan is let go. {PER_JOINT}',
        unit='rad or m',
        minimum=0.0,
        applies=AT_START,
    )
    max_plan_points: int = setting(
        10_000,
        'Longest plan that is followed; longer ones are refused. Torques pause for about 10 ms '
        'where a plan of 10,000 points is read.',
        minimum=2,
        maximum=100_000,
        applies=AT_START,
    )
    several_publishers: str = setting(
        'warn',
        'Where joint_states has several publishers: follow plans all the same, say so in the '
        'status too, or follow none. Allow those of other joints, such as of a gripper.',
        choices=('allow', 'warn', 'refuse'),
        applies=AT_START,
    )
    executor: str = executor_setting()


@dataclass(frozen=True, eq=False)
class ControlRules:
    """
    The settings as arrays of shape (n,), in the order of the joints.

    ConfigError if there is no joint or one comes twice, a list has another length than there are,
    or limits are not given.
    """

    gains: Gains
    limits: Array
    rates: Array
    start_tolerance: Array
    path_tolerance: Array

    @classmethod
    def of(cls, settings: ControlSettings) -> ControlRules:
        """Bring the settings into the order of the joints."""
        joints = settings.joints
        require_unique('joints', joints)
        if not joints:
            raise ConfigError('joints must name the joints to control, but is empty.')
        for name in ('stiffness', 'damping'):
            _require_length(name, getattr(settings, name), len(joints))

        require_limits(settings.torque_limits)

        def per_joint(name: str) -> Array:
            values = limits_in_numbers(getattr(settings, name))
            return by_joint(name, values, joints, joints, np.inf)

        limits = per_joint('torque_limits')
        with np.errstate(over='ignore'):  # limits beyond all numbers leave rates without a bound
            rates = DEFAULT_RATE * limits
        if settings.rate_limits:
            rates = per_joint('rate_limits')
        return cls(
            gains=Gains(np.array(settings.stiffness), np.array(settings.damping)),
            limits=limits,
            rates=rates,
            start_tolerance=per_joint('start_tolerance'),
            path_tolerance=per_joint('path_tolerance'),
        )


def _require_length(name: str, values: Sequence[float], n: int) -> None:
    if len(values) != n:
        raise ConfigError(
            f'{name} must have one number for each of {n} joints, but has {len(values)}.'
        )
