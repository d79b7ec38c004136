"""Covariance functions: energy kernels, what is not Lagrangian, and the whole torque prior."""

from lip_id_ros.kernels.features import JointBasis
from lip_id_ros.kernels.jointwise import Friction, JointwiseKernel, Residual
from lip_id_ros.kernels.prior import Hyperparameters, JointStates, TorqueKernel, TorquePrior
from lip_id_ros.kernels.program import EnergyKernel, FAMILY
from lip_id_ros.kernels.rigid_links import ARTICULATED, RigidLinks
from lip_id_ros.kernels.weights import Weights

__all__ = [
    'ARTICULATED',
    'FAMILY',
    'EnergyKernel',
    'Friction',
    'Hyperparameters',
    'JointBasis',
    'JointStates',
    'JointwiseKernel',
    'Residual',
    'RigidLinks',
    'TorqueKernel',
    'TorquePrior',
    'Weights',
]
