"""Rigid-body arms from a URDF through pinocchio, such as the Panda: the truth of simulations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import copy
from importlib import metadata
import os
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError, LipIdError
from lip_id_ros.joint_types import PRISMATIC, REVOLUTE
from lip_id_ros.simulation.trajectories import MotionLimits

N_JOINTS = 7
URDF_SUFFIX = 'panda_description/urdf/panda.urdf'

# an elbow-up posture for the joints that are locked, fingers closed
LOCKED_AT = (0.0, -0.3, 0.0, -2.0, 0.0, 1.8, 0.7, 0.0, 0.0)

MOTION = MotionLimits(  # the paper's table joint_limits: eight tenths of each joint's range
    q_min=np.array([-2.3, -1.4, -2.3, -2.7, -2.3, 0.2, -2.3]),
    q_max=np.array([2.3, 1.4, 2.3, -0.3, 2.3, 3.2, 2.3]),
    dq_max=np.array([2.2, 2.2, 2.2, 2.2, 2.6, 2.6, 2.6]),
    ddq_max=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
)


class Dynamics(Protocol):
    """What a simulated data set needs to know of an arm; all arrays of motions are (N, n)."""

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (N, n)."""

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Kinetic energy [J], shape (N,)."""

    def potential(self, q: Array) -> Array:
        """Potential energy [J], shape (N,), up to a constant."""


class SimulatedArm:
    """
    Serial arm of rigid bodies without friction.

    `urdf`: robot description; meshes are not needed. `n_joints`: number of joints kept, from the
    base; the later ones are locked, their links stay. `locked_at`: positions [rad or m] of all
    movable joints of the URDF, of which those of the locked joints are used; pinocchio's neutral
    configuration by default. OSError if the URDF cannot be opened; DataError if it has too few
    joints, or joints that are neither revolute nor prismatic; LipIdError if pinocchio is not
    installed.
    """

    def __init__(
        self,
        urdf: str | os.PathLike[str],
        n_joints: int,
        locked_at: Sequence[float] | None = None,
    ) -> None:
        self._pinocchio = _import_pinocchio()
        self._model = self._reduced(Path(urdf), n_joints, locked_at)
        self._data = self._model.createData()
        self.joint_names: tuple[str, ...] = tuple(self._model.names)[1:]
        self.joint_types = tuple(_joint_type(joint) for joint in list(self._model.joints)[1:])

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the torques [N m or N] of motions of shape (N, n), by recursive Newton-Euler."""
        return self._each(self._pinocchio.rnea, q, dq, ddq)

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Kinetic energy [J], shape (N,), of motions of shape (N, n)."""
        return self._each(self._pinocchio.computeKineticEnergy, q, dq)

    def potential(self, q: Array) -> Array:
        """Potential energy [J], shape (N,), zero where all mass is at the height of the base."""
        return self._each(self._pinocchio.computePotentialEnergy, q)

    def changed(self, change: Callable[[Any], None]) -> SimulatedArm:
        """Copy whose pinocchio model has been changed in place by a function."""
        other = copy.copy(self)
        other._model = self._model.copy()
        change(other._model)
        other._data = other._model.createData()
        return other

    def _each(self, algorithm: Callable[..., Any], *motion: Array) -> Array:
        rows = zip(*motion, strict=True)
        # pinocchio returns views of one work space
        return np.array([np.copy(algorithm(self._model, self._data, *row)) for row in rows])

    def _reduced(self, urdf: Path, n_joints: int, locked_at: Sequence[float] | None) -> Any:
        pin = self._pinocchio
        try:
            model = pin.buildModelFromXML(urdf.read_text(encoding='utf-8'))
        except ValueError as error:  # not text, or no robot in it
            raise DataError(f'{urdf} is not a URDF ({error}); give another file.') from error
        if not 1 <= n_joints <= model.njoints - 1:
            raise DataError(
                f'{n_joints} joints were asked of {urdf}, which has {model.njoints - 1}; '
                'ask for one to as many.'
            )
        locked = [model.getJointId(name) for name in tuple(model.names)[n_joints + 1 :]]
        at = pin.neutral(model) if locked_at is None else np.array(locked_at, dtype=np.float64)
        return pin.buildReducedModel(model, locked, at)


def _import_pinocchio() -> Any:
    try:
        import pinocchio  # optional: only simulations need it
    except ImportError as error:
        raise LipIdError(
            f'a simulated arm needs pinocchio ({error}); '
            "install it with `pip install 'lip_id_ros[sim]'`."
        ) from error
    return pinocchio


def _joint_type(joint: Any) -> str:
    name = joint.shortname()
    if joint.nq == joint.nv == 1 and name.startswith('JointModelR'):
        return REVOLUTE
    if joint.nq == joint.nv == 1 and name.startswith('JointModelP'):
        return PRISMATIC
    raise DataError(
        f'joints must be revolute or prismatic, not {name}; '
        'give a continuous joint limits in the URDF.'
    )


def panda(n_joints: int = N_JOINTS) -> SimulatedArm:
    """
    Panda with its hand, whose fingers are closed.

    Later joints than the first `n_joints`, 1 to 7, are locked in an elbow-up posture.

    LipIdError if pinocchio or example-robot-data is not installed, DataError if `n_joints` is out
    of range.
    """
    return SimulatedArm(panda_urdf(), n_joints, LOCKED_AT)


def panda_urdf() -> Path:
    """Return the Panda's URDF of example-robot-data; LipIdError if that is not installed."""
    try:
        files = metadata.files('example-robot-data') or []
    except metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.as_posix().endswith(URDF_SUFFIX):
            return Path(str(file.locate()))
    raise LipIdError(
        f'the simulated Panda needs {URDF_SUFFIX} of the package example-robot-data, which is '
        "not installed; install it with `pip install 'lip_id_ros[sim]'`."
    )
