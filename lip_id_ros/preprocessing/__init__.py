"""From raw joint samples to data sets: filter, differentiate, cut into segments, select."""

from lip_id_ros.preprocessing.description import describe
from lip_id_ros.preprocessing.pipeline import preprocess
from lip_id_ros.preprocessing.selection import for_training

__all__ = ['describe', 'for_training', 'preprocess']
