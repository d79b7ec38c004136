"""From a trained model to torques, energies and their uncertainty."""

from lip_id_ros.model import TrainedModel
from lip_id_ros.serving.predictor import Prediction, Predictor, Query
from lip_id_ros.serving.uncertainty import Deviation

__all__ = ['Deviation', 'Prediction', 'Predictor', 'Query', 'TrainedModel']
