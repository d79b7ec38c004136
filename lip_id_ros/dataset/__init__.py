"""What is learned from: joint motions and torques in one checked, read-only container."""

from lip_id_ros.dataset.checks import JOINT_TYPES
from lip_id_ros.dataset.dataset import Dataset
from lip_id_ros.dataset.joining import concatenate
from lip_id_ros.dataset.writing import writer_for

__all__ = ['JOINT_TYPES', 'Dataset', 'concatenate', 'writer_for']
