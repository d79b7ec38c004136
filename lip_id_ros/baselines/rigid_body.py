"""Identification of rigid-body parameters with known kinematics, by weighted least squares."""

from __future__ import annotations

import os

import numpy as np
from scipy.linalg import lstsq

from lip_id_ros.arrays import Array
from lip_id_ros.baselines.interface import Answer
from lip_id_ros.baselines.regressor import Regressor
from lip_id_ros.dataset import Dataset
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

REPEATS = 3  # of the weighting
PRECISION = 1e-8  # smaller singular values, relative to the largest, count as zero
STAGE = 'least squares'


class RigidBody:
    """
    The paper's estimator ID (eq. linear_model).

    Ten parameters per link, and per joint viscous and Coulomb friction, an offset and the inertia
    of the rotor. Joints are weighted by the inverse variance of what is left over, as is usual in
    identification; of parameters that no torque tells apart the smallest are taken, which gives
    the same torques and energies.

    Parameters
    ----------
    urdf : path
        Where the kinematics come from.

    """

    def __init__(self, urdf: str | os.PathLike[str]) -> None:
        self._urdf = urdf

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Identified:
        """Identify from all samples."""
        features = RigidBodyFeatures(Regressor(self._urdf, dataset))
        phi = features.torque(dataset.q, dataset.dq, dataset.ddq)
        deviation = np.ones(dataset.n_joints)
        floor = 1e-9 * dataset.tau.std(axis=0) + np.finfo(np.float64).tiny
        for repeat in range(REPEATS):
            parameters = _weighted(phi, dataset.tau, deviation)
            left_over = dataset.tau - phi @ parameters
            deviation = np.maximum(left_over.std(axis=0), floor)
            progress(STAGE, repeat + 1, REPEATS)
        return Identified(features, parameters)


class Identified:
    """
    Torques and energies of identified parameters.

    Parameters
    ----------
    features : RigidBodyFeatures
    parameters : ndarray, shape (14 n,)

    """

    def __init__(self, features: RigidBodyFeatures, parameters: Array) -> None:
        self._features = features
        self._parameters = parameters
        self.size = parameters.size

    def predict(self, q: Array, dq: Array, ddq: Array) -> Answer:
        """Estimate torques and both energies; that of the rotors is part of the kinetic one."""
        features, parameters = self._features, self._parameters
        return Answer(
            features.torque(q, dq, ddq) @ parameters,
            features.kinetic(q, dq) @ parameters,
            features.potential(q) @ parameters,
        )


class RigidBodyFeatures:
    """
    The regressor of the links, and that of the joints beside it.

    Parameters
    ----------
    links : Regressor

    """

    def __init__(self, links: Regressor) -> None:
        self._links = links

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return Phi, shape (N, n, 14 n): links, viscous, Coulomb, offset, rotor."""
        columns = (dq, np.sign(dq), np.ones_like(dq), ddq)
        return np.concatenate(
            [self._links.torque(q, dq, ddq), *(_diagonal(x) for x in columns)], axis=2
        )

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Return rows, shape (N, 14 n), whose product with the parameters is T [J]."""
        none = np.zeros((len(q), 3 * q.shape[1]))
        return np.hstack([self._links.kinetic(q, dq), none, 0.5 * np.square(dq)])

    def potential(self, q: Array) -> Array:
        """Return rows, shape (N, 14 n), whose product with the parameters is V [J]."""
        return np.hstack([self._links.potential(q), np.zeros((len(q), 4 * q.shape[1]))])


def _weighted(phi: Array, tau: Array, deviation: Array) -> Array:
    rows = (phi / deviation[:, None]).reshape(-1, phi.shape[2])
    scale = np.linalg.norm(rows, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    found, *_ = lstsq(rows / scale, (tau / deviation).ravel(), cond=PRECISION)
    return np.asarray(found) / scale


def _diagonal(x: Array) -> Array:
    """Return one column per joint that acts on that joint only, (N, n) to (N, n, n)."""
    return x[:, :, None] * np.eye(x.shape[1])
