"""Simulated arms, exciting motions, and recordings of them."""

from lip_id_ros.simulation.arm import Dynamics, panda, SimulatedArm
from lip_id_ros.simulation.closed_loop import (
    Drives,
    FrictionalArm,
    JointFriction,
    Measurement,
    no_contact,
    NominalFeedforward,
    placed,
    TorqueControlledArm,
    track,
    Tracking,
)
from lip_id_ros.simulation.datasets import make_dataset, with_encoder_noise, with_truth, write_bag
from lip_id_ros.simulation.trajectories import (
    GrowingCosine,
    MotionLimits,
    SinusoidTrajectory,
    StoppedTrajectory,
)

__all__ = [
    'Drives',
    'Dynamics',
    'FrictionalArm',
    'GrowingCosine',
    'JointFriction',
    'Measurement',
    'MotionLimits',
    'NominalFeedforward',
    'SimulatedArm',
    'SinusoidTrajectory',
    'StoppedTrajectory',
    'TorqueControlledArm',
    'Tracking',
    'make_dataset',
    'no_contact',
    'panda',
    'placed',
    'track',
    'with_encoder_noise',
    'with_truth',
    'write_bag',
]
