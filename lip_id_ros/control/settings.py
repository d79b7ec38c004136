"""Parameters of the node `computed_torque`."""

from __future__ import annotations

from dataclasses import dataclass

from lip_id_ros.settings import setting, Settings
from lip_id_ros.settings.nodes import AT_START, EXECUTOR_HELP, EXECUTORS


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
    torque_limits: tuple[float, ...] = setting(
        (),
        'Largest magnitude of each torque; empty for none.',
        unit='N m or N',
        minimum=0.0,
        applies=AT_START,
    )
    executor: str = setting('events', EXECUTOR_HELP, choices=EXECUTORS, applies=AT_START)
