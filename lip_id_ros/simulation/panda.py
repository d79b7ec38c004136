"""The Franka Emika Panda of the PyPI package example-robot-data, and the motions of the paper."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import numpy as np

from lip_id_ros.errors import LipIdError
from lip_id_ros.simulation.arm import SimulatedArm
from lip_id_ros.simulation.trajectories import MotionLimits

N_JOINTS = 7
URDF_SUFFIX = 'panda_description/urdf/panda.urdf'

# an elbow-up posture for the joints that are locked, fingers closed
LOCKED_AT = (0.0, -0.3, 0.0, -2.0, 0.0, 1.8, 0.7, 0.0, 0.0)

MOTION = MotionLimits(  # the paper's table joint_limits: about half of each joint's range
    q_min=np.array([-2.3, -1.4, -2.3, -2.7, -2.3, 0.2, -2.3]),
    q_max=np.array([2.3, 1.4, 2.3, -0.3, 2.3, 3.2, 2.3]),
    dq_max=np.array([2.2, 2.2, 2.2, 2.2, 2.6, 2.6, 2.6]),
    ddq_max=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
)


def panda(n_joints: int = N_JOINTS) -> SimulatedArm:
    """
    Panda with its hand, whose fingers are closed.

    Parameters
    ----------
    n_joints : int
        1 to 7 joints from the base; the others are locked in an elbow-up posture.

    Returns
    -------
    SimulatedArm

    Raises
    ------
    LipIdError
        If pinocchio or example-robot-data is not installed.
    DataError
        If `n_joints` is out of range.

    """
    return SimulatedArm(panda_urdf(), n_joints, LOCKED_AT)


def panda_urdf() -> Path:
    """
    Where example-robot-data installed the Panda's URDF.

    Raises
    ------
    LipIdError
        If the package is not installed.

    """
    try:
        files = metadata.files('example-robot-data') or []
    except metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.as_posix().endswith(URDF_SUFFIX):
            return Path(str(file.locate()))
    raise LipIdError(
        f'the simulated Panda needs {URDF_SUFFIX} of the package example-robot-data, which is '
        'not installed; install it with `pip install lip_id_ros[sim]`.'
    )
