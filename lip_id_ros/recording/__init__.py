"""Recordings of joint states: raw samples by joint name, nothing invented."""

from lip_id_ros.recording.bags import Bag, Topic
from lip_id_ros.recording.buffer import SampleBuffer
from lip_id_ros.recording.description import DATASET_SUFFIX, describe
from lip_id_ros.recording.joint_samples import JointSamples
from lip_id_ros.recording.mapping import Reason
from lip_id_ros.recording.reading import read_bag, read_sources
from lip_id_ros.recording.trajectories import read_trajectory, Trajectory

__all__ = [
    'DATASET_SUFFIX',
    'Bag',
    'JointSamples',
    'Reason',
    'SampleBuffer',
    'Topic',
    'Trajectory',
    'describe',
    'read_bag',
    'read_sources',
    'read_trajectory',
]
