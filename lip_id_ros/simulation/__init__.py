"""Simulated arms, exciting motions, and recordings of them."""

from lip_id_ros.simulation.arm import Dynamics, panda, SimulatedArm
from lip_id_ros.simulation.datasets import make_dataset, with_encoder_noise, with_truth, write_bag
from lip_id_ros.simulation.torque_controlled import (
    Drives,
    JointFriction,
    Measurement,
    TorqueControlledArm,
)
from lip_id_ros.simulation.trajectories import (
    GrowingCosine,
    MotionLimits,
    SinusoidTrajectory,
    StoppedTrajectory,
)

__all__ = [
    'Drives',
    'Dynamics',
    'GrowingCosine',
    'JointFriction',
    'Measurement',
    'MotionLimits',
    'SimulatedArm',
    'SinusoidTrajectory',
    'StoppedTrajectory',
    'TorqueControlledArm',
    'make_dataset',
    'panda',
    'with_encoder_noise',
    'with_truth',
    'write_bag',
]
