"""Simulated arms, exciting motions, and recordings of them."""

from lip_id_ros.simulation.arm import Dynamics, panda, SimulatedArm
from lip_id_ros.simulation.datasets import make_dataset, with_encoder_noise, with_truth, write_bag
from lip_id_ros.simulation.trajectories import (
    MotionLimits,
    SinusoidTrajectory,
)

__all__ = [
    'Dynamics',
    'MotionLimits',
    'SimulatedArm',
    'SinusoidTrajectory',
    'make_dataset',
    'panda',
    'with_encoder_noise',
    'with_truth',
    'write_bag',
]
