"""Parameters of the simulated nodes."""

from __future__ import annotations

from dataclasses import dataclass

from lip_id_ros.settings import executor_setting, setting, Settings
from lip_id_ros.settings.settings import AT_START

JOINTS_HELP = 'Joints of the Panda, from the base.'


@dataclass(frozen=True)
class ArmSettings(Settings):
    """The node `simulated_arm`."""

    n_joints: int = setting(7, JOINTS_HELP, minimum=1, maximum=7, applies=AT_START)
    seed: int = setting(0, 'Seed of all noise.', minimum=0, applies=AT_START)
    contact: tuple[float, ...] = setting(
        (), 'External torque on each joint, as of a contact; empty for none.', unit='N m'
    )
    executor: str = executor_setting()


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
    executor: str = executor_setting()


@dataclass(frozen=True)
class RobotSettings(Settings):
    """The node `simulated_panda`."""

    seed: int = setting(1, 'Seed of the motion; change it for another motion.', minimum=0)
    paused: bool = setting(False, 'Stand still and publish nothing.')
    rate_hz: float = setting(100.0, 'Samples per simulated second.', unit='Hz', minimum=1.0)
    speed: float = setting(2.0, 'Simulated seconds per second.', minimum=0.01)
    torque_noise: float = setting(0.05, 'Noise on efforts.', unit='N m', minimum=0.0)
    position_noise: float = setting(2e-5, 'Noise on positions.', unit='rad', minimum=0.0)
    velocity_noise: float = setting(1e-3, 'Noise on velocities.', unit='rad/s', minimum=0.0)
    executor: str = executor_setting()
