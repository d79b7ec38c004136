"""From raw joint samples to data sets: filter, differentiate, cut into segments, select."""

from lip_id_ros.preprocessing.description import describe
from lip_id_ros.preprocessing.election import election_lines
from lip_id_ros.preprocessing.loading import load_dataset, with_elected
from lip_id_ros.preprocessing.pipeline import preprocess
from lip_id_ros.preprocessing.selection import for_training

__all__ = [
    'describe',
    'election_lines',
    'for_training',
    'load_dataset',
    'preprocess',
    'with_elected',
]
