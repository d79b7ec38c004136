"""Parameters of the node `serve`: declaration, types, ranges and descriptions in one place."""

from __future__ import annotations

from dataclasses import dataclass

from lip_id_ros.errors import ConfigError
from lip_id_ros.settings import Row, rows, setting, Settings
from lip_id_ros.settings.nodes import (
    AT_START,
    EXECUTOR_HELP,
    EXECUTORS,
    ON_CONFIGURE,
    ON_LOAD,
    parameters_of,
    PER_JOINT,
)

POLICIES = ('off', 'warn', 'scale', 'zero')


@dataclass(frozen=True)
class ServeSettings(Settings):
    """The node `serve`."""

    model_path: str = setting(
        'model.npz',
        'Model to serve; also read by the service reload_model.',
        applies=ON_LOAD,
    )
    joints: tuple[str, ...] = setting(
        (),
        'Joints that the model must have, in any order, and that every list here is given for; '
        'empty to take any model and its order.',
        applies=ON_CONFIGURE,
    )
    torque_limits: tuple[float, ...] = setting(
        (), f'Largest torque or force. {PER_JOINT}', unit='N m or N', minimum=0.0
    )
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
        'Time in which a stream takes over from what was sent before: after activation, enable, '
        'reload, stale references, and a change of gravity, output_scale or a policy. A ramp that '
        'is under way continues from where it is when this changes.',
        unit='s',
        minimum=0.0,
        maximum=60.0,
    )
    gravity: bool = setting(True, 'Torques include gravity; false where the robot adds its own.')
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
        choices=('zero', 'gravity'),
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
        'Longest plan that is answered; longer ones are refused. Plans of more than about a '
        'hundred points are computed in a process beside the stream, which starts with the first.',
        minimum=1,
        maximum=100_000,
    )
    range_policy: str = setting(
        'warn',
        'For references outside the training range: count and warn, scale torques down until '
        'they are zero at twice the range, or make them zero.',
        choices=POLICIES,
    )
    range_margin: tuple[float, ...] = setting(
        (0.2,),
        f'What a joint may go beyond its training range, as a share of half of it. {PER_JOINT}',
        minimum=0.0,
    )
    std_policy: str = setting(
        'off',
        'For streams with a torque whose standard deviation is above its limit: count and warn, '
        'scale torques down until they are zero at twice the limit, or make them zero.',
        applies=ON_CONFIGURE,
        choices=POLICIES,
    )
    std_limits: tuple[float, ...] = setting(
        (),
        f'Largest standard deviation of a torque, for std_policy. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
    )
    std_rate_hz: float = setting(
        5.0,
        'How often standard deviations are computed, at most; each takes milliseconds of a '
        'process of its own.',
        unit='Hz',
        minimum=0.1,
        maximum=1000.0,
    )
    enabled: bool = setting(True, 'Answer references; the service enable sets it too.')
    publish_commands: bool = setting(
        False,
        'Also publish torques on ~/commands, for a forward_command_controller.',
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
    follow_joint_states: bool = setting(
        True,
        'Take joint_states, for measured energies, the torque residual and the stale policy '
        'gravity.',
        applies=ON_CONFIGURE,
    )
    residual_cutoff_hz: float = setting(
        4.0,
        'Cut-off of the low-pass on measured signals before ~/torque_residual.',
        unit='Hz',
        minimum=0.01,
        maximum=1000.0,
    )
    autostart: bool = setting(True, 'Configure and activate at the start.', applies=AT_START)
    executor: str = setting('events', EXECUTOR_HELP, choices=EXECUTORS, applies=AT_START)

    @property
    def needs_deviations(self) -> bool:
        """Whether standard deviations are computed at all."""
        return self.publish_std or self.std_policy != 'off'


def serve_parameters() -> dict[str, Row]:
    """Return all parameters of `serve` by name."""
    return parameters_of(ServeSettings)


def require_changeable(before: ServeSettings, after: ServeSettings, state: str) -> None:
    """
    Refuse a change that would have no effect now.

    Parameters
    ----------
    before, after : ServeSettings
    state : str
        Of the lifecycle.

    Raises
    ------
    ConfigError
        If a parameter is read when the node is configured, and it is.

    """
    if state == 'unconfigured':
        return
    for row in rows(ServeSettings):
        changed = getattr(before, row.name) != getattr(after, row.name)
        if changed and row.applies == ON_CONFIGURE:
            raise ConfigError(
                f'{row.name} is read when the node is configured, which it is; clean it up first.'
            )
