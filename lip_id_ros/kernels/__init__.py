"""Covariance functions: energy kernels, what is not Lagrangian, and the whole torque prior."""

from lip_id_ros.kernels.features import JointBasis
from lip_id_ros.kernels.per_joint import Friction, PerJointKernel, Residual
from lip_id_ros.kernels.posterior import TorquePosterior
from lip_id_ros.kernels.prior import Hyperparameters, JointStates, TorqueKernel, TorquePrior
from lip_id_ros.kernels.program import EnergyKernel, FAMILY, Weights

__all__ = [
    'FAMILY',
    'EnergyKernel',
    'Friction',
    'Hyperparameters',
    'JointBasis',
    'JointStates',
    'PerJointKernel',
    'Residual',
    'TorqueKernel',
    'TorquePosterior',
    'TorquePrior',
    'Weights',
]
