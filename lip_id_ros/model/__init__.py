"""What a fit leaves behind: a trained model, in memory and as one file."""

from lip_id_ros.model.trained_model import TrainedModel

__all__ = ['TrainedModel']
