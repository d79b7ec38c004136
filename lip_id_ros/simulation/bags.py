"""Recordings of a simulated arm, as its driver would have published them."""

from __future__ import annotations

import os

from lip_id_ros.dataset import Dataset
from lip_id_ros.recording.bag_writer import JointStateTrack, write_bag_folder


def write_bag(
    path: str | os.PathLike[str],
    dataset: Dataset,
    start: float = 0.0,
    topic: str = '/joint_states',
) -> None:
    """
    Write what was measured into a rosbag2 folder (MCAP, sensor_msgs/JointState).

    Parameters
    ----------
    path : path
        The folder to be made.
    dataset : Dataset
        One message per sample: q, dq and tau; the rest of it stays behind.
    start : float
        Stamp [s] of the data set's time zero.
    topic : str

    Raises
    ------
    OSError
        If the folder exists or cannot be made.

    """
    track = JointStateTrack(
        topic,
        dataset.joint_names,
        dataset.t + start,
        position=dataset.q,
        velocity=dataset.dq,
        effort=dataset.tau,
    )
    write_bag_folder(path, [track])
