"""Covariance functions: energy kernels, friction, and the prior and posterior of the torques."""

from lip_id_ros.kernels.features import JointBasis
from lip_id_ros.kernels.program import EnergyKernel, FAMILY, Weights
from lip_id_ros.kernels.torque_process import (
    FrictionKernel,
    Hyperparameters,
    JointStates,
    TorqueKernel,
    TorquePosterior,
    TorquePrior,
)

__all__ = [
    'FAMILY',
    'EnergyKernel',
    'FrictionKernel',
    'Hyperparameters',
    'JointBasis',
    'JointStates',
    'TorqueKernel',
    'TorquePosterior',
    'TorquePrior',
    'Weights',
]
