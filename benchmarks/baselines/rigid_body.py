"""Identification with known kinematics by least squares: smooth Coulomb friction, or ours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq

from benchmarks.baselines import Baseline, Methods, Urdf
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.urdf import load_description
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.identification.arm_prior import link_prior_std
from lip_id_ros.identification.friction_selection import select_friction
from lip_id_ros.model import TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
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


def known_chain(urdf: Urdf, dataset: Dataset) -> Chain:
    """Return the kinematics of a URDF for the joints of a data set; its masses are not used."""
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


def contiguous(*arrays: Array) -> tuple[Array, ...]:
    """Return arrays as compiled functions take them."""
    return tuple(np.ascontiguousarray(x) for x in arrays)


@dataclass(frozen=True)
class SmoothFriction:
    """Viscous and Coulomb friction, and an offset, of each joint, shape (3 n,)."""

    sign_width: Array
    coefficients: Array

    def torque(self, q: Array, dq: Array, ddq: Array, load: Array) -> Array:
        """Return the torque of friction, shape (N, n)."""
        viscous, coulomb, offset = self.coefficients.reshape(3, -1)
        return np.asarray(viscous * dq + coulomb * smooth_sign(dq, self.sign_width) + offset)


class RigidBody(Baseline):
    """Torques and energies of identified links, shape (11 n,), and of friction."""

    has_potential = True

    def __init__(
        self, data: Dataset, chain: Chain, links: Array, friction: SmoothFriction | FrictionModel
    ) -> None:
        super().__init__(data.joint_names, data.joint_types)
        self._chain, self._links, self.friction = chain, links, friction

    @property
    def size(self) -> int:
        """Number of numbers that the model keeps."""
        return self._links.size + self.friction.coefficients.size

    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        """Return torques and both energies; the kinetic one includes that of the rotors."""
        q, dq, ddq = contiguous(q, dq, ddq)
        load = torque_regressor(self._chain, q, dq, ddq) @ self._links
        return TorquePrediction(
            load + self.friction.torque(q, dq, ddq, load),
            kinetic_regressor(self._chain, q, dq) @ self._links,
            potential_regressor(self._chain, q) @ self._links,
        )


@dataclass(frozen=True)
class Identification:
    """
    The paper's estimator ID (eq. linear_model), with a smooth sign of Coulomb friction.

    Ten parameters per link, and per joint viscous and Coulomb friction, an offset and the inertia
    of the rotor. Joints are weighted by the inverse variance of their residual, as is usual in
    identification; of parameters with the same torques the smallest are taken.

    """

    urdf: Urdf

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> RigidBody:
        """Identify from all samples."""
        chain = known_chain(self.urdf, dataset)
        features = chosen_features(chain, dataset)
        phi = features.torque(dataset.q, dataset.dq, dataset.ddq)
        parameters, _ = identified(phi, dataset.tau)
        progress('least squares', REPEATS, REPEATS)
        links, own = np.split(parameters, [LINK_PARAMETERS * dataset.n_joints])
        return RigidBody(dataset, chain, links, SmoothFriction(features.sign_width, own))


@dataclass(frozen=True)
class FrictionIdentification:
    """
    Least squares on rigid links and the friction terms that the default fit has on offer.

    The rival that has everything of the default fit and the true kinematics: what is selected, and
    how, is the same (`lip_id_ros.identification.friction_selection`).

    """

    urdf: Urdf

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> RigidBody:
        """Select friction and identify from all samples."""
        chain = known_chain(self.urdf, dataset)
        selected = select_friction(dataset, chain, link_prior_std(dataset))
        progress('selection of friction', 1, 1)
        return RigidBody(dataset, chain, selected.link_parameters.ravel(), selected.friction)


METHODS: Methods = {
    'rigid_body': Identification,
    'rigid_body_friction': FrictionIdentification,
}


def chosen_features(chain: Chain, dataset: Dataset) -> RigidBodyFeatures:
    """
    Choose the width of each joint's smooth sign by the prediction of left-out blocks.

    Blocks are consecutive in time. One width in units of each joint's velocity is chosen for all
    joints, then that of one joint after another.

    """
    unit = 2.0 * np.sqrt(np.mean(np.square(dataset.dq), axis=0))
    trial = _WidthTrial(chain, dataset, unit)
    everywhere = [np.full(dataset.n_joints, width) for width in range(len(WIDTHS))]
    choice = min(everywhere, key=trial.error)
    for joint in SWEEPS * list(range(dataset.n_joints)):
        own = np.arange(dataset.n_joints) == joint
        choice = min((np.where(own, k, choice) for k in range(len(WIDTHS))), key=trial.error)
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

    def error(self, choice: Array) -> float:
        """Return the sum of squared errors of all left-out blocks, in units of the residuals'."""
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
