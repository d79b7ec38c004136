"""
The equations of motion as a linear function of dynamic parameters, by pinocchio from a URDF.

tau = Phi(q, dq, ddq) w (paper, eq. linear_model). The kinematics are taken from the URDF, its
masses and inertias are not.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import os
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.baselines.interface import State, Urdf
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.rigid_body import Chain

_Z = np.array([0.0, 0.0, 1.0])


class Regressor:
    """
    Phi and its like for the energies, ten parameters for each moving body.

    Parameters
    ----------
    urdf : str
        Robot description; meshes are not needed.
    place : str
        Its file, for messages.
    joint_names : tuple of str
        The other joints of the URDF are fixed at zero.
    gravity_compensated : bool
        Whether the torques exclude gravity.

    Raises
    ------
    DataError
        If it is not a URDF, or a joint is missing in it.

    """

    def __init__(
        self, urdf: str, place: str, joint_names: Sequence[str], gravity_compensated: bool
    ) -> None:
        self.state: State = {
            'urdf': urdf,
            'place': place,
            'joint_names': list(joint_names),
            'gravity_compensated': gravity_compensated,
        }
        self._model = _reduced(_built(urdf, place), joint_names, place)
        if gravity_compensated:
            self._model.gravity.setZero()
        self._data = self._model.createData()
        ids = [self._model.getJointId(name) for name in joint_names]
        self._columns = [self._model.joints[i].idx_v for i in ids]
        self._neutral = pinocchio.neutral(self._model)

    @classmethod
    def of(cls, urdf: Urdf, dataset: Dataset) -> Regressor:
        """
        Read a URDF for the joints of a data set.

        Raises
        ------
        OSError
            If it cannot be opened.
        DataError
            If it is not a URDF, or a joint is missing in it.

        """
        place = os.fspath(urdf)
        try:
            text = Path(urdf).read_text(encoding='utf-8')
        except UnicodeDecodeError as error:
            raise _no_urdf(place, error) from error
        return cls(text, place, dataset.joint_names, dataset.gravity_compensated)

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return Phi, shape (N, n, 10 n), at joint states of shape (N, n)."""
        found = self._each(pinocchio.computeJointTorqueRegressor, q, dq, ddq)
        return found[:, self._columns, :]

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Return rows, shape (N, 10 n), whose product with the parameters is T [J]."""
        return self._each(pinocchio.computeKineticEnergyRegressor, q, dq)

    def potential(self, q: Array) -> Array:
        """Return rows, shape (N, 10 n), whose product with the parameters is V [J]."""
        return self._each(pinocchio.computePotentialEnergyRegressor, q)

    def chain(self) -> Chain:
        """
        Return the placements of the joints, with their axes along z.

        Raises
        ------
        DataError
            If the joints are no serial chain in the order of the data.

        """
        model, n = self._model, len(self._columns)
        if self._columns != list(range(n)) or list(model.parents)[1:] != list(range(n)):
            raise DataError(
                f'joints in the order from base to tip were expected, but {self.state["place"]} '
                f'has the order {", ".join(list(model.names)[1:])}; give the joints in that order.'
            )
        before, rotations, translations, prismatic = np.eye(3), [], [], []
        for joint in range(1, n + 1):
            place = model.jointPlacements[joint]
            subspace = pinocchio.computeJointJacobian(model, self._data, self._neutral, joint)
            linear, angular = subspace[:3, joint - 1], subspace[3:, joint - 1]
            prismatic.append(not angular.any())
            turn, _ = Rotation.align_vectors([linear if prismatic[-1] else angular], [_Z])
            rotations.append(before.T @ place.rotation @ turn.as_matrix())
            translations.append(before.T @ place.translation)
            before = turn.as_matrix()
        gravity = np.array(model.gravity.linear)
        return Chain(np.array(rotations), np.array(translations), np.array(prismatic), gravity)

    def _each(self, algorithm: Callable[..., Any], q: Array, *rest: Array) -> Array:
        configurations = [
            pinocchio.integrate(self._model, self._neutral, row) for row in self._ordered(q)
        ]
        rows = zip(configurations, *(self._ordered(x) for x in rest), strict=True)
        # pinocchio returns views of one work space
        return np.array([np.copy(algorithm(self._model, self._data, *row)) for row in rows])

    def _ordered(self, x: Array) -> Array:
        ordered = np.empty_like(x)
        ordered[:, self._columns] = x
        return ordered


def _built(urdf: str, place: str) -> Any:
    try:
        return pinocchio.buildModelFromXML(urdf)
    except ValueError as error:
        raise _no_urdf(place, error) from error


def _no_urdf(place: str, error: Exception) -> DataError:
    return DataError(f'{place} is not a URDF ({error}); give another file.')


def _reduced(model: Any, joint_names: Sequence[str], urdf: str) -> Any:
    known = tuple(model.names)[1:]
    missing = [name for name in joint_names if name not in known]
    if missing:
        raise DataError(
            f'joint {missing[0]!r} of the data is not in {urdf}, which has {", ".join(known)}; '
            'give the URDF of this robot, or name the joints as it does.'
        )
    locked = [model.getJointId(name) for name in known if name not in joint_names]
    return pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model))
