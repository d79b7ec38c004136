"""The data set: joint motions and torques in one checked, read-only container."""

from lip_id_ros.dataset.dataset import concatenate, Dataset
from lip_id_ros.dataset.formats import cutoffs_hz, DATASET_SUFFIX

__all__ = [
    'DATASET_SUFFIX',
    'Dataset',
    'concatenate',
    'cutoffs_hz',
]
