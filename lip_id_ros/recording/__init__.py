"""Recordings of joint states: raw samples by joint name, nothing invented."""

from lip_id_ros.recording.bags import Bag, Topic
from lip_id_ros.recording.buffer import SampleBuffer
from lip_id_ros.recording.joint_samples import JointSamples, Reason
from lip_id_ros.recording.reading import read_bag, read_sources

__all__ = [
    'Bag',
    'JointSamples',
    'Reason',
    'SampleBuffer',
    'Topic',
    'read_bag',
    'read_sources',
]
