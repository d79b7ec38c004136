"""Parameters of the node `monitor`."""

from __future__ import annotations

from dataclasses import dataclass

from lip_id_ros.settings import setting, Settings
from lip_id_ros.settings.nodes import AT_START, EXECUTOR_HELP, EXECUTORS, PER_JOINT


@dataclass(frozen=True)
class MonitorSettings(Settings):
    """The node `monitor`."""

    model_path: str = setting('model.npz', 'Model of the arm.', applies=AT_START)
    joints: tuple[str, ...] = setting(
        (),
        'Joints that the model must have, in any order, and that every list here is given for; '
        'empty to take any model and its order.',
        applies=AT_START,
    )
    rate_hz: float = setting(
        100.0,
        'How often joint states are taken, at most; each costs about ten queries of the model.',
        unit='Hz',
        minimum=1.0,
        maximum=1000.0,
        applies=AT_START,
    )
    smallest_contact: tuple[float, ...] = setting(
        (5.0,),
        f'Smallest contact that is to be detected; calibrate uses it. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
        applies=AT_START,
    )
    thresholds: tuple[float, ...] = setting(
        (),
        'High-pass of the external torque above which a joint is in contact, as the status has '
        f'them after calibrate; empty: no contact is detected before calibrate. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
        applies=AT_START,
    )
    calibration_s: float = setting(
        60.0,
        'How much motion without contact calibrate watches.',
        unit='s',
        minimum=1.0,
        applies=AT_START,
    )
    hold_s: float = setting(
        0.5, 'How long a contact is published at least.', unit='s', minimum=0.0, applies=AT_START
    )
    executor: str = setting('events', EXECUTOR_HELP, choices=EXECUTORS, applies=AT_START)
