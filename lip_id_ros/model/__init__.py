"""Trained models: what they answer, in memory and as one file."""

from lip_id_ros.model.torque_model import (
    DynamicsModel,
    Prediction,
    Query,
    StandardDeviation,
    TorqueModel,
    TorquePrediction,
)
from lip_id_ros.model.trained_model import TrainedModel

__all__ = [
    'DynamicsModel',
    'Prediction',
    'Query',
    'StandardDeviation',
    'TorqueModel',
    'TorquePrediction',
    'TrainedModel',
]
