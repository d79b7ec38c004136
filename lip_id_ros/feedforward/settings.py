"""Parameters of the node `serve`, and the limits on torques that follow for a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from lip_id_ros.adaptation.follow_settings import (
    follow_rules,
    follow_setting,
    FollowRules,
)
from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.settings import description_setting, executor_setting, rows, setting, Settings
from lip_id_ros.settings.settings import AT_ONCE, AT_START, ON_CONFIGURE, ON_LOAD, PER_JOINT
from lip_id_ros.signals.joints import by_joint, require_unique
from lip_id_ros.signals.torque_steps import (
    DEFAULT_RATE,
    limits_in_force,
    LimitsFrom,
    require_limits,
)


class Policy(StrEnum):
    """What is done with a reference that a check finds doubtful."""

    IGNORE = 'ignore'
    WARN = 'warn'
    SCALE = 'scale'
    ZERO = 'zero'


class Overload(StrEnum):
    """What is done with a plan whose torques would exceed their limits."""

    CUT = 'cut'
    REFUSE = 'refuse'
    SLOW = 'slow'


class SafeValue(StrEnum):
    """What is published when references stop."""

    ZERO = 'zero'
    GRAVITY = 'gravity'


@dataclass(frozen=True)
class ServeSettings(Settings):
    """The node `serve`."""

    model_path: str = setting(
        'model.npz',
        'Model to serve; also read by the service reload_model.',
        applies=ON_LOAD,
    )
    payload_models: tuple[str, ...] = setting(
        (),
        'Models of the same arm with payloads, as `lip_id payload -o` writes them: loaded beside '
        'model_path, to be selected by payload.',
        applies=ON_LOAD,
    )
    payload: str = setting(
        '',
        'The model among payload_models that answers; empty for that of model_path. A change '
        'loads nothing, and torques are ramped to.',
    )
    accept_unproven: bool = setting(
        False,
        'Serve models too that were not judged on motion that they had not seen, or leave 80 % '
        "or more of a torque's variance unexplained there; configure and reload_model refuse "
        'them otherwise.',
        applies=ON_LOAD,
    )
    joints: tuple[str, ...] = setting(
        (),
        'Joints that the model must have, in any order, and that every list here is given for; '
        'empty to take any model and its order.',
        applies=ON_CONFIGURE,
    )
    torque_limits: tuple[float, ...] = setting(
        (),
        f'Largest torque or force; without it the node does not activate. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
        old_values={
            'none': 'torque_limits_from: none',
            'robot_description': 'torque_limits_from: robot_description',
        },
    )
    torque_limits_from: str = setting(
        'parameters',
        'Where limits of torques come from: torque_limits, the URDF, which is read when the node '
        'is activated, or none for a simulation without limits.',
        choices=tuple(LimitsFrom),
    )
    robot_description: str = description_setting()
    rate_limits: tuple[float, ...] = setting(
        (),
        'Largest change of a torque or force; empty: twenty times torque_limits per second, so '
        f'that a full swing takes at least 0.1 s, and no bound without torque_limits. {PER_JOINT}',
        unit='N m/s or N/s',
        minimum=0.0,
    )
    output_scale: float = setting(
        1.0, 'Factor on every torque before it is limited.', minimum=0.0, maximum=1.0
    )
    ramp_s: float = setting(
        0.5,
        'Time in which a stream takes over from the torques before: after activation, enable, '
        'reload, stale references, and a change of gravity, output_scale or a policy. A ramp '
        'begins with the next torque; one under way continues from where it is when this changes. '
        'It counts at most 0.05 s between two torques, so slow streams take longer.',
        unit='s',
        minimum=0.0,
        maximum=60.0,
    )
    gravity: bool = setting(True, 'Torques include gravity; false where the robot adds its own.')
    friction: bool = setting(
        True, 'Torques include friction; false where the drives compensate their own.'
    )
    stale_timeout_s: float = setting(
        0.5,
        'Longest silence of a stream before a safe torque is published; 0 for any.',
        unit='s',
        minimum=0.0,
    )
    stale_policy: str = setting(
        'zero',
        'The safe torque: zero, or gravity where the arm was last seen (measured, else asked '
        'for); zero all the same where gravity is false.',
        choices=tuple(SafeValue),
    )
    safe_ramp_s: float = setting(
        0.1,
        'Time in which torques go to the safe torque once references have stopped; rate_limits '
        'hold as well.',
        unit='s',
        minimum=0.0,
        maximum=1.0,
    )
    max_plan_points: int = setting(
        10_000,
        'Longest plan that is answered, with the points that refine_plans adds; longer ones are '
        'refused. A thousand points take 10 to 30 ms, in which no stream is answered.',
        minimum=1,
        maximum=10_000,
    )
    refine_plans: bool = setting(
        True,
        'Add points to plans, on the way that the controller takes between theirs, where it would '
        'interpolate efforts badly. Without them the status warns of plans that are too sparse.',
    )
    overload_policy: str = setting(
        'cut',
        'For plans whose torques would exceed torque_limits, at their points or between them: '
        'cut the torques, refuse the plan, or slow it down until it fits (not below a tenth of '
        'its speed). Looking at a plan of 10 s takes about 10 ms, at one of minutes up to 0.2 s.',
        choices=tuple(Overload),
    )
    range_policy: str = setting(
        'warn',
        'For references outside the training range: count and warn, scale torques down until '
        'they are zero at twice the range, or make them zero.',
        choices=tuple(Policy),
        old_values={'off': 'ignore', 'False': 'ignore'},  # as YAML reads off
    )
    range_margin: tuple[float, ...] = setting(
        (0.2,),
        'Distance that a joint may go beyond its training range, as a share of half of it. '
        f'{PER_JOINT}',
        minimum=0.0,
    )
    std_rate_hz: float = setting(
        5.0,
        'How often standard deviations are computed, at most.',
        unit='Hz',
        minimum=0.1,
        maximum=1000.0,
    )
    enabled: bool = setting(True, 'Answer references; the service enable sets it too.')
    publish_commands: bool = setting(
        False,
        'Also publish torques on ~/commands, for a forward_command_controller, in the order of '
        'joints.',
        applies=ON_CONFIGURE,
    )
    publish_parts: bool = setting(
        False,
        'Also publish the parts of the torque on ~/torque/inertial, coriolis, gravity and '
        'friction.',
        applies=ON_CONFIGURE,
    )
    publish_std: bool = setting(
        False,
        'Also publish standard deviations of torques on ~/torque_std.',
        applies=ON_CONFIGURE,
    )
    follow_controller: bool = setting(
        False,
        'Also answer the reference of a running joint_trajectory_controller, on '
        '~/controller_state.',
        applies=ON_CONFIGURE,
    )
    controller_action: str = setting(
        '',
        'Action FollowJointTrajectory of a controller, such as '
        '/arm_controller/follow_joint_trajectory: offered as ~/follow_joint_trajectory too, with '
        'efforts filled in. Empty for none.',
        applies=ON_CONFIGURE,
    )
    follow_joint_states: bool = setting(
        True,
        'Take joint_states, for measured energies, the torque residual and the stale policy '
        'gravity.',
        applies=ON_CONFIGURE,
    )
    several_publishers: str = setting(
        'warn',
        'Where ~/desired_trajectory or joint_states has several publishers: answer all the same, '
        'say so in the status too, or refuse all references. Allow those of other joints.',
        choices=('allow', 'warn', 'refuse'),
    )
    residual_cutoff_hz: float = setting(
        4.0,
        'Cut-off of the low-pass on measured signals before ~/torque_residual.',
        unit='Hz',
        minimum=0.01,
        maximum=1000.0,
    )
    follow_adaptation: bool = follow_setting(
        'follow_adaptation', AT_ONCE, ' A model that was loaded without this cannot begin to.'
    )
    blend_s: float = follow_setting('blend_s', AT_ONCE)
    adaptation_timeout_s: float = follow_setting('adaptation_timeout_s', AT_ONCE)
    adaptation_limit: tuple[float, ...] = follow_setting('adaptation_limit', AT_ONCE)
    autostart: bool = setting(
        False,
        'Configure and activate at the start, without a launch file that does.',
        applies=AT_START,
    )
    executor: str = executor_setting()


def require_changeable(before: ServeSettings, after: ServeSettings, state: str) -> None:
    """Raise ConfigError for a change of what is read when the node is configured."""
    if state == 'unconfigured':
        return
    for row in rows(ServeSettings):
        changed = getattr(before, row.name) != getattr(after, row.name)
        if changed and row.applies == ON_CONFIGURE:
            raise ConfigError(
                f'{row.name} is read when the node is configured, which it is; clean it up first.'
            )


@dataclass(frozen=True, eq=False)
class Rules:
    """
    The settings that hold for every torque, in the order of a model's joints.

    `limits`, `rates`, shape (n,): largest magnitude and change, infinite where there is none.
    `ramp_s`: time to blend from the torque sent before to the one asked for [s]. `safe_ramp_s`: to
    the safe torque once references have stopped. `stale_timeout_s`: longest silence of a stream,
    infinite for any, and `safe_value`: what follows it. `range_policy`: what is done outside the
    training range widened by `margins`, shape (n,), as a share of half of it. `overload`: what is
    done with a plan that would exceed the limits. `follow`: how updates are followed.
    """

    limits: Array
    rates: Array
    scale: float
    ramp_s: float
    safe_ramp_s: float
    gravity: bool
    friction: bool
    stale_timeout_s: float
    safe_value: SafeValue
    max_plan_points: int
    overload: Overload
    range_policy: Policy
    margins: Array
    follow: FollowRules

    def same_torque(self, other: Rules) -> bool:
        """Whether both make the same torque of one reference, but for limits and rates."""
        return (
            self.scale == other.scale
            and self.gravity == other.gravity
            and self.friction == other.friction
            and self.range_policy == other.range_policy
            and np.array_equal(self.margins, other.margins)
        )


def make_rules(settings: ServeSettings, joint_names: Sequence[str]) -> Rules:
    """Bring the settings into the order of a model's joints; ConfigError if they do not fit."""
    require_consistent(settings)

    def per_joint(name: str, default: float) -> Array:
        return by_joint(name, getattr(settings, name), settings.joints, joint_names, default)

    in_force = limits_in_force(settings.torque_limits, settings.torque_limits_from)
    limits = by_joint('torque_limits', in_force, settings.joints, joint_names, np.inf)
    with np.errstate(over='ignore'):  # limits beyond all numbers leave rates without a bound
        rates = DEFAULT_RATE * limits
    if settings.rate_limits:
        rates = per_joint('rate_limits', np.inf)
    return Rules(
        limits=limits,
        rates=rates,
        scale=settings.output_scale,
        ramp_s=settings.ramp_s,
        safe_ramp_s=settings.safe_ramp_s,
        gravity=settings.gravity,
        friction=settings.friction,
        stale_timeout_s=settings.stale_timeout_s or np.inf,
        safe_value=SafeValue(settings.stale_policy),
        max_plan_points=settings.max_plan_points,
        overload=Overload(settings.overload_policy),
        range_policy=Policy(settings.range_policy),
        margins=per_joint('range_margin', 0.0),
        follow=follow_rules(settings, joint_names),
    )


def require_consistent(settings: ServeSettings) -> None:
    """Raise ConfigError for settings that contradict each other for any arm."""
    require_unique('joints', settings.joints)
    if settings.rate_limits and not min(settings.rate_limits) > 0.0:
        raise ConfigError(
            f'rate_limits must be above zero, but are {list(settings.rate_limits)}: a torque '
            'could not be taken back; leave them empty for the usual ones.'
        )
    if not all(settings.payload_models):
        raise ConfigError(
            'payload_models must name a file each, but one is empty; the empty name is that of '
            'model_path.'
        )


def require_bounded(settings: ServeSettings, before: Rules, joint_names: Sequence[str]) -> None:
    """Raise ConfigError for settings that take a limit away from a node that is active."""
    require_limits('torque_limits', settings.torque_limits, settings.torque_limits_from)
    after = make_rules(settings, joint_names)
    for name, old, new in (
        ('torque_limits', before.limits, after.limits),
        ('rate_limits', before.rates, after.rates),
    ):
        if (np.isfinite(old) & ~np.isfinite(new)).any():
            raise ConfigError(
                f'{name} can be changed but not removed while the node is active; deactivate it '
                'first.'
            )


def unbounded(settings: ServeSettings) -> str | None:
    """Return the warning that is due where nothing bounds the size or the step of a torque."""
    if limits_in_force(settings.torque_limits, settings.torque_limits_from):
        return None
    steps = '' if settings.rate_limits else ', and neither are their steps'
    return f'torques are not limited{steps}'
