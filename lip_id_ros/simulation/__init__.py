"""Simulated arms, exciting motions and the recordings that they would give."""

from lip_id_ros.simulation.arm import Arm, Dynamics
from lip_id_ros.simulation.bags import write_bag
from lip_id_ros.simulation.datasets import make_dataset, with_encoder_noise, with_truth
from lip_id_ros.simulation.friction import Friction, FrictionalArm
from lip_id_ros.simulation.limits import MotionLimits
from lip_id_ros.simulation.panda import panda
from lip_id_ros.simulation.trajectories import SinusoidTrajectory

__all__ = [
    'Arm',
    'Dynamics',
    'Friction',
    'FrictionalArm',
    'MotionLimits',
    'SinusoidTrajectory',
    'make_dataset',
    'panda',
    'with_encoder_noise',
    'with_truth',
    'write_bag',
]
