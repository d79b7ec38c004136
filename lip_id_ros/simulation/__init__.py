"""Simulated arms, exciting motions and the recordings that they would give."""

from lip_id_ros.simulation.arm import Arm, Dynamics
from lip_id_ros.simulation.bags import write_bag
from lip_id_ros.simulation.closed_loop import no_contact, placed, track, Tracking
from lip_id_ros.simulation.datasets import make_dataset, with_encoder_noise, with_truth
from lip_id_ros.simulation.friction import Friction, FrictionalArm, SmoothFriction
from lip_id_ros.simulation.limits import MotionLimits
from lip_id_ros.simulation.nominal import NominalFeedforward
from lip_id_ros.simulation.panda import panda
from lip_id_ros.simulation.torque_controlled import Drives, Measurement, TorqueControlledArm
from lip_id_ros.simulation.trajectories import SinusoidTrajectory

__all__ = [
    'Arm',
    'Drives',
    'Dynamics',
    'Friction',
    'FrictionalArm',
    'Measurement',
    'MotionLimits',
    'NominalFeedforward',
    'SinusoidTrajectory',
    'SmoothFriction',
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
