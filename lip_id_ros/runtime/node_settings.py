"""Parameters of the nodes beside `train` and `serve`."""

from __future__ import annotations

from dataclasses import dataclass

from lip_id_ros.runtime.settings import AT_START, EXECUTOR_HELP, EXECUTORS, PER_JOINT
from lip_id_ros.settings import setting, Settings

JOINTS_HELP = 'Joints of the Panda, from the base.'


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
        f'Smallest contact that is to be told; calibrate uses it. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
        applies=AT_START,
    )
    thresholds: tuple[float, ...] = setting(
        (),
        'Sudden external torques above which a joint is touched, as the status has them after '
        f'calibrate; empty: none is told before calibrate. {PER_JOINT}',
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
        0.5, 'How long a contact is told at least.', unit='s', minimum=0.0, applies=AT_START
    )
    executor: str = setting('events', EXECUTOR_HELP, choices=EXECUTORS, applies=AT_START)


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


@dataclass(frozen=True)
class ArmSettings(Settings):
    """The node `simulated_arm`."""

    n_joints: int = setting(7, JOINTS_HELP, minimum=1, maximum=7, applies=AT_START)
    seed: int = setting(0, 'Seed of all noise.', minimum=0, applies=AT_START)
    contact: tuple[float, ...] = setting(
        (), 'External torque on each joint, as of a contact; empty for none.', unit='N m'
    )
    executor: str = setting('events', EXECUTOR_HELP, choices=EXECUTORS, applies=AT_START)


@dataclass(frozen=True)
class ReferenceSettings(Settings):
    """The node `reference`."""

    n_joints: int = setting(7, JOINTS_HELP, minimum=1, maximum=7, applies=AT_START)
    amplitude: float = setting(
        0.6, 'Reached at the horizon.', unit='rad', minimum=0.0, applies=AT_START
    )
    horizon: float = setting(
        10.0, 'Length of the motion.', unit='s', minimum=0.1, applies=AT_START
    )
    executor: str = setting('events', EXECUTOR_HELP, choices=EXECUTORS, applies=AT_START)
