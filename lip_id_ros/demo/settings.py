"""Parameters of the simulated nodes."""

from __future__ import annotations

from dataclasses import dataclass

from lip_id_ros.settings import setting, Settings
from lip_id_ros.settings.nodes import AT_START, EXECUTOR_HELP, EXECUTORS

JOINTS_HELP = 'Joints of the Panda, from the base.'


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
