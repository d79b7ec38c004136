"""Parameters of the node `monitor`."""

from __future__ import annotations

from dataclasses import dataclass

from lip_id_ros.adaptation.follow_settings import follow_setting
from lip_id_ros.monitoring.detection import LEAST_AT_REST, TORQUE_ERROR
from lip_id_ros.monitoring.external_torque import BANDWIDTH
from lip_id_ros.settings import executor_setting, setting, Settings
from lip_id_ros.settings.settings import AT_ONCE, AT_START, PER_JOINT

DEVIATIONS_OF = ('deviation_constant', 'deviation_torque', 'deviation_inertial', 'deviation_rest')
"""Parameters that hold the rows of `Deviation.shares`."""


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
        'Smallest contact that is to be detected; refused where the last calibration says that it '
        f'would not show. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
        applies=AT_ONCE,
    )
    deviation_constant: tuple[float, ...] = setting(
        (),
        'Deviation of the external torque in free motion, as the status has it after calibrate; '
        f'empty: no contact is detected before calibrate. {PER_JOINT}',
        unit='N m or N',
        minimum=0.0,
        applies=AT_START,
    )
    deviation_torque: tuple[float, ...] = setting(
        (TORQUE_ERROR,),
        'Its share of the measured torque, or the least that calibrate takes: 0.1 for torques '
        f'from motor currents, 0.02 for torque sensors. {PER_JOINT}',
        minimum=0.0,
        applies=AT_START,
    )
    deviation_inertial: tuple[float, ...] = setting(
        (0.0,), f'Its share of the inertial torque. {PER_JOINT}', minimum=0.0, applies=AT_START
    )
    deviation_rest: tuple[float, ...] = setting(
        (LEAST_AT_REST,),
        f'Its share of the friction that changes sign near rest. {PER_JOINT}',
        minimum=0.0,
        applies=AT_START,
    )
    bandwidth: float = setting(
        BANDWIDTH,
        'Of the observer: a larger one detects contacts sooner, and shows more noise; calibrate '
        'anew after a change.',
        unit='1/s',
        minimum=1.0,
        maximum=1000.0,
        applies=AT_START,
    )
    calibration_s: float = setting(
        60.0,
        'How much motion without contact calibrate watches.',
        unit='s',
        minimum=1.0,
        maximum=600.0,
        applies=AT_START,
    )
    hold_s: float = setting(
        0.5, 'How long a contact is published at least.', unit='s', minimum=0.0, applies=AT_START
    )
    follow_adaptation: bool = follow_setting('follow_adaptation', AT_START)
    blend_s: float = follow_setting('blend_s', AT_START)
    adaptation_timeout_s: float = follow_setting('adaptation_timeout_s', AT_START)
    adaptation_limit: tuple[float, ...] = follow_setting('adaptation_limit', AT_START)
    executor: str = executor_setting()
