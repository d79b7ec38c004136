"""Data sets and bags of a simulated arm, with the true torques and energies."""

from __future__ import annotations

from dataclasses import replace
import os

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.recording.bag_writer import JointStateTrack, write_bag_folder
from lip_id_ros.simulation.arm import Dynamics
from lip_id_ros.simulation.trajectories import Trajectory


def make_dataset(
    arm: Dynamics,
    trajectory: Trajectory,
    t: Array,
    noise_std: float | Array,
    rng: np.random.Generator,
) -> Dataset:
    """
    Return torques and energies of an arm along a trajectory at times (N,) [s], with the truth.

    `noise_std`, a number or (n,), is the deviation of white noise on the torques [N m or N].
    """
    q, dq, ddq = trajectory.sample(t)
    tau = arm.inverse_dynamics(q, dq, ddq)
    return Dataset(
        t=t,
        q=q,
        dq=dq,
        ddq=ddq,
        tau=tau + noise_std * rng.standard_normal(tau.shape),
        joint_names=arm.joint_names,
        joint_types=arm.joint_types,
        segment=np.zeros(len(t), dtype=np.int64),
        tau_noiseless=tau,
        kinetic=arm.kinetic(q, dq),
        potential=arm.potential(q),
        provenance={'sources': ['simulation']},
    )


def with_encoder_noise(
    dataset: Dataset, position_std: float, velocity_std: float, rng: np.random.Generator
) -> Dataset:
    """Put white noise of these deviations on positions and velocities alone."""
    return replace(
        dataset,
        q=dataset.q + position_std * rng.standard_normal(dataset.q.shape),
        dq=dataset.dq + velocity_std * rng.standard_normal(dataset.dq.shape),
    )


def with_truth(
    dataset: Dataset, arm: Dynamics, trajectory: Trajectory, start: float = 0.0
) -> Dataset:
    """
    Set what was measured on a simulated arm beside the exact torques and energies.

    `start` is the time [s] in the data set at which the trajectory was at its time zero.
    """
    q, dq, ddq = trajectory.sample(dataset.t - start)
    return replace(
        dataset,
        tau_noiseless=arm.inverse_dynamics(q, dq, ddq),
        kinetic=arm.kinetic(q, dq),
        potential=arm.potential(q),
    )


def write_bag(
    path: str | os.PathLike[str],
    dataset: Dataset,
    start: float = 0.0,
    topic: str = '/joint_states',
) -> None:
    """
    Write q, dq and tau into a rosbag2 folder (MCAP, sensor_msgs/JointState).

    `start` is the stamp [s] of the data set's time zero.

    OSError if the folder exists or cannot be made.
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
