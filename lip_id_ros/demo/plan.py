"""A plan for `serve`: many points at once, which must come back with efforts."""

from __future__ import annotations

import os

from builtin_interfaces.msg import Duration
import numpy as np
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.demo import topics
from lip_id_ros.errors import DataError
from lip_id_ros.nodes import messages
from lip_id_ros.recording.bags import Bag
from lip_id_ros.simulation import panda, SinusoidTrajectory
from lip_id_ros.simulation.panda import MOTION

N_POINTS = 100
STEP_MS = 100


def make_plan(seed: int) -> JointTrajectory:
    """Return the beginning of a motion as a plan of `N_POINTS` points."""
    trajectory = SinusoidTrajectory.random(MOTION, np.random.default_rng(seed))
    motion = trajectory.sample(1e-3 * STEP_MS * np.arange(N_POINTS, dtype=np.float64))
    points = [
        JointTrajectoryPoint(
            positions=messages.doubles(q),
            velocities=messages.doubles(dq),
            accelerations=messages.doubles(ddq),
            time_from_start=_after(row * STEP_MS),
        )
        for row, (q, dq, ddq) in enumerate(zip(*motion, strict=True))
    ]
    return JointTrajectory(joint_names=list(panda().joint_names), points=points)


def require_efforts(bag_path: str | os.PathLike[str]) -> None:
    """
    Check the answer to the plan in a bag of the demo.

    Raises
    ------
    DataError
        If it has not an effort for every joint at every point.

    """
    with Bag(bag_path) as bag:
        plans = [plan for _, plan in bag.messages(topics.PLAN_WITH_EFFORT)]
    efforts = [point.effort for plan in plans for point in plan.points]
    n_joints = len(panda().joint_names)
    if len(efforts) != N_POINTS or any(len(effort) != n_joints for effort in efforts):
        raise DataError(
            f'a plan of {N_POINTS} points must come back with {n_joints} efforts at each, but '
            f'{len(efforts)} points came; see nodes.log.'
        )


def _after(milliseconds: int) -> Duration:
    sec, rest = divmod(milliseconds, 1000)
    return Duration(sec=sec, nanosec=rest * 1_000_000)
