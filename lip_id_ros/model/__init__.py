"""Models of inverse dynamics: what they predict, in memory and as one file."""

from lip_id_ros.model.effort_calibration import EffortCalibration
from lip_id_ros.model.inverse_dynamics_model import InverseDynamicsModel
from lip_id_ros.model.torque_model import (
    DynamicsModel,
    Prediction,
    Query,
    StandardDeviation,
    TorqueModel,
    TorquePrediction,
)

__all__ = [
    'DynamicsModel',
    'EffortCalibration',
    'InverseDynamicsModel',
    'Prediction',
    'Query',
    'StandardDeviation',
    'TorqueModel',
    'TorquePrediction',
]
