"""From a trained model to torques, energies and their uncertainty."""

from lip_id_ros.serving.predictor import Predictor

__all__ = ['Predictor']
