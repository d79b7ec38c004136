"""The data set: joint motions and torques in one checked, read-only container."""

from lip_id_ros.dataset.dataset import concatenate, Dataset
from lip_id_ros.dataset.formats import DATASET_SUFFIX
from lip_id_ros.dataset.provenance import cutoffs_hz

__all__ = [
    'DATASET_SUFFIX',
    'Dataset',
    'concatenate',
    'cutoffs_hz',
]
