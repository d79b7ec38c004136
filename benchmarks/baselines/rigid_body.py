"""Identification of rigid-body parameters with known kinematics, by weighted least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq

from benchmarks.baselines.interface import Baseline, Methods, Urdf
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.urdf import load_description
from lip_id_ros.model import TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)
from lip_id_ros.settings import FitSettings

REPEATS = 3  # of the weighting
PRECISION = 1e-8  # smaller singular values, relative to the largest, count as zero
WIDTHS = (0.0, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32)
"""
Candidate widths of the smooth sign, in units of twice the root mean square velocity of the joint;
0 is the jump of the textbook.
"""
BLOCKS = 5  # of the training data, each left out once
SWEEPS = 2  # over the joints
STAGE = 'least squares'


def known_chain(urdf: Urdf, dataset: Dataset) -> Chain:
    """
    Return the kinematics of a URDF for the joints of a data set; its masses are not used.

    Raises
    ------
    OSError
        If it cannot be opened.
    DataError
        If it is not a URDF, or not of this arm.

    """
    chain = load_description(urdf, dataset.joint_names, dataset.joint_types).chain
    return chain._replace(gravity=0.0 * chain.gravity) if dataset.gravity_compensated else chain


@dataclass(frozen=True)
class RigidBodyFeatures:
    """
    The regressor of the links and that of the joints (paper, eq. linear_model).

    `sign_width`, shape (n,), is the velocity [rad/s or m/s] at which Coulomb friction has tanh(1)
    of its size; 0 for a jump.

    """

    chain: Chain
    sign_width: Array

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return Phi, shape (N, n, 14 n): links with rotors, viscous, Coulomb, offset."""
        columns = (dq, smooth_sign(dq, self.sign_width), np.ones_like(dq))
        links = torque_regressor(self.chain, *contiguous(q, dq, ddq))
        return np.concatenate([links, *(diagonal(x) for x in columns)], axis=2)

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Return rows, shape (N, 14 n), whose product with the parameters is T [J]."""
        return _without_friction(kinetic_regressor(self.chain, *contiguous(q, dq)), q)

    def potential(self, q: Array) -> Array:
        """Return rows, shape (N, 14 n), whose product with the parameters is V [J]."""
        return _without_friction(potential_regressor(self.chain, *contiguous(q)), q)


def contiguous(*arrays: Array) -> tuple[Array, ...]:
    """Return arrays as compiled functions take them."""
    return tuple(np.ascontiguousarray(x) for x in arrays)


def _without_friction(links: Array, q: Array) -> Array:
    return np.hstack([links, np.zeros((len(q), 3 * q.shape[1]))])


class RigidBody(Baseline):
    """Torques and energies of identified parameters, shape (14 n,)."""

    has_potential = True

    def __init__(
        self,
        joint_names: tuple[str, ...],
        joint_types: tuple[str, ...],
        features: RigidBodyFeatures,
        parameters: Array,
    ) -> None:
        super().__init__(joint_names, joint_types)
        self._features = features
        self._parameters = parameters

    @property
    def size(self) -> int:
        """Number of numbers that the model keeps."""
        return self._parameters.size

    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        """Return torques and both energies; the kinetic one includes that of the rotors."""
        features, parameters = self._features, self._parameters
        return TorquePrediction(
            features.torque(q, dq, ddq) @ parameters,
            features.kinetic(q, dq) @ parameters,
            features.potential(q) @ parameters,
        )


class Identification:
    """
    The paper's estimator ID (eq. linear_model), with a smooth sign of Coulomb friction.

    Ten parameters per link, and per joint viscous and Coulomb friction, an offset and the inertia
    of the rotor. Joints are weighted by the inverse variance of their residual, as is usual in
    identification; of parameters with the same torques the smallest are taken.

    """

    def __init__(self, urdf: Urdf) -> None:
        self._urdf = urdf

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Baseline:
        """Identify from all samples."""
        features = chosen_features(known_chain(self._urdf, dataset), dataset)
        phi = features.torque(dataset.q, dataset.dq, dataset.ddq)
        parameters, _ = identified(phi, dataset.tau)
        progress(STAGE, REPEATS, REPEATS)
        return RigidBody(dataset.joint_names, dataset.joint_types, features, parameters)


METHODS: Methods = {'rigid_body': Identification}


def chosen_features(chain: Chain, dataset: Dataset) -> RigidBodyFeatures:
    """
    Choose the width of each joint's smooth sign by the prediction of left-out blocks.

    Blocks are consecutive in time. One width in units of each joint's velocity is chosen for all
    joints, then that of one joint after another.

    """
    unit = 2.0 * np.sqrt(np.mean(np.square(dataset.dq), axis=0))
    trial = _WidthTrial(chain, dataset, unit)
    n = dataset.n_joints
    choice = min(
        (np.full(n, width) for width in range(len(WIDTHS))), key=lambda each: trial.error(each)
    )
    for joint in SWEEPS * list(range(n)):
        candidates = [choice.copy() for _ in WIDTHS]
        for width, candidate in enumerate(candidates):
            candidate[joint] = width
        choice = min(candidates, key=lambda each: trial.error(each))
    return RigidBodyFeatures(chain, np.array(WIDTHS)[choice] * unit)


class _WidthTrial:
    """
    Errors of left-out blocks for every choice of widths, from Gram matrices of all columns.

    The matrix of a block holds the Coulomb columns of all candidate widths, so that a choice
    selects columns and needs no samples.

    """

    def __init__(self, chain: Chain, dataset: Dataset, unit: Array) -> None:
        n = dataset.n_joints
        q, dq, ddq, tau = dataset.q, dataset.dq, dataset.ddq, dataset.tau
        signs = [smooth_sign(dq, width * unit) for width in WIDTHS]
        joints = [diagonal(x) for x in (dq, np.ones_like(dq), *signs)]
        phi = np.concatenate([torque_regressor(chain, *contiguous(q, dq, ddq)), *joints], axis=2)
        self._n_fixed = phi.shape[2] - n * len(WIDTHS)
        narrow = phi[:, :, : self._n_fixed + n]  # with the jump
        _, residual_std = identified(narrow, tau)
        rows = np.concatenate([phi, tau[:, :, None]], axis=2) / residual_std[:, None]
        blocks = np.array_split(rows, BLOCKS)
        self._gram = np.array([np.tensordot(x, x, axes=([0, 1], [0, 1])) for x in blocks])
        self._known: dict[bytes, float] = {}

    def error(self, choice: Array) -> float:
        """Return the sum of squared errors of all left-out blocks, in units of the residuals'."""
        key = choice.tobytes()
        if key not in self._known:
            self._known[key] = self._error(choice)
        return self._known[key]

    def _error(self, choice: Array) -> float:
        n = len(choice)
        signs = self._n_fixed + choice * n + np.arange(n)
        columns = np.concatenate([np.arange(self._n_fixed), signs, [self._gram.shape[1] - 1]])
        gram = self._gram[:, columns][:, :, columns]
        total = gram.sum(axis=0)
        return float(sum(_left_out_error(total - block, block) for block in gram))


def _left_out_error(rest: Array, block: Array) -> float:
    """Return the squared error on a block of the parameters fitted to the rest."""
    scale = np.sqrt(np.diag(rest)[:-1])
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(rest[:-1, :-1] / np.outer(scale, scale))
    inverse = np.where(values > PRECISION * values[-1], 1.0 / np.maximum(values, 1e-300), 0.0)
    parameters = vectors @ (inverse * (vectors.T @ (rest[:-1, -1] / scale))) / scale
    weights = np.append(-parameters, 1.0)
    return float(weights @ block @ weights)


def smooth_sign(dq: Array, width: Array) -> Array:
    """Return tanh(dq / width), shape (N, n), and sign(dq) where the width (n,) is 0."""
    smooth = np.tanh(dq / np.where(width > 0, width, 1.0))
    return np.where(width > 0, smooth, np.sign(dq))


def identified(phi: Array, tau: Array) -> tuple[Array, Array]:
    """Return parameters, and the standard deviation of each joint's residual."""
    std = np.ones(tau.shape[1])
    floor = 1e-9 * tau.std(axis=0) + np.finfo(np.float64).tiny
    for _ in range(REPEATS):
        parameters = _weighted(phi, tau, std)
        std = np.maximum((tau - phi @ parameters).std(axis=0), floor)
    return parameters, std


def _weighted(phi: Array, tau: Array, std: Array) -> Array:
    rows = (phi / std[:, None]).reshape(-1, phi.shape[2])
    scale = np.linalg.norm(rows, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    found, *_ = lstsq(rows / scale, (tau / std).ravel(), cond=PRECISION)
    return np.asarray(found) / scale


def diagonal(x: Array) -> Array:
    """Return one column per joint that acts on that joint only, (N, n) to (N, n, n)."""
    return x[:, :, None] * np.eye(x.shape[1])
