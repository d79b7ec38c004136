"""From raw joint samples to data sets: filter, differentiate, cut into segments, select."""

from lip_id_ros.preprocessing.description import describe
from lip_id_ros.preprocessing.pipeline import for_training, preprocess

__all__ = ['describe', 'for_training', 'preprocess']
