"""Simulated arms, exciting motions, and recordings of them."""

from lip_id_ros.simulation.arm import Dynamics, panda, SimulatedArm
from lip_id_ros.simulation.closed_loop import (
    no_contact,
    NominalFeedforward,
    placed,
    track,
    Tracking,
)
from lip_id_ros.simulation.datasets import make_dataset, with_encoder_noise, with_truth, write_bag
from lip_id_ros.simulation.torque_controlled import (
    Drives,
    FrictionalArm,
    FrictionTorque,
    Measurement,
    SmoothFrictionTorque,
    TorqueControlledArm,
)
from lip_id_ros.simulation.trajectories import GrowingCosine, MotionLimits, SinusoidTrajectory

__all__ = [
    'Drives',
    'Dynamics',
    'FrictionTorque',
    'FrictionalArm',
    'GrowingCosine',
    'Measurement',
    'MotionLimits',
    'NominalFeedforward',
    'SimulatedArm',
    'SinusoidTrajectory',
    'SmoothFrictionTorque',
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
