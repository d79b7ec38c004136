"""The simulated Panda of the closed loops: its posture, drives, friction, sensors and gains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.control.settings import Gains
from lip_id_ros.simulation.arm import panda, SimulatedArm
from lip_id_ros.simulation.torque_controlled import Drives, JointFriction

# The maker's ready posture: far from the limits that zero is beyond (joint 4) or at (joint 6).
POSTURE = (0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4)
# With these the nominal model's errors and feedback come out as large as the paper's.
STIFFNESS = (600.0, 600.0, 400.0, 300.0, 200.0, 120.0, 70.0)
DAMPING = (40.0, 40.0, 25.0, 20.0, 10.0, 8.0, 5.0)
VISCOUS = (0.5, 0.5, 0.5, 0.5, 0.25, 0.25, 0.25)
COULOMB = (0.6, 0.9, 0.6, 1.2, 0.8, 0.3, 0.5)
SIGN_WIDTH = 0.01
ROTOR_INERTIA = 0.1


@dataclass(frozen=True)
class Setup:
    """An arm of rigid bodies without rotors, its drives and gains, and its posture (n,) [rad]."""

    arm: SimulatedArm
    drives: Drives
    gains: Gains
    posture: Array


def panda_setup(n_joints: int = 7) -> Setup:
    """
    Return the first joints of a Panda.

    LipIdError if pinocchio or example-robot-data is not installed, DataError if `n_joints` is out
    of range.
    """
    stiffness, damping, viscous, coulomb, posture = (
        np.array(values[:n_joints]) for values in (STIFFNESS, DAMPING, VISCOUS, COULOMB, POSTURE)
    )
    drives = Drives(
        rotor_inertia=np.full(n_joints, ROTOR_INERTIA),
        friction=JointFriction(viscous, coulomb, SIGN_WIDTH),
        ripple=0.02,
        position_noise=2e-5,
        velocity_noise=1e-3,
        torque_noise=0.05,
        delay=1,
    )
    return Setup(panda(n_joints), drives, Gains(stiffness, damping), posture)
