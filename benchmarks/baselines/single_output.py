"""
A Gaussian process for every joint's torque by itself: SE, GIP and the semiparametric one.

A covariance is a sum of terms. A term turns motions into features once, in NumPy, and its
covariance is a function of those and of log-hyperparameters that torch differentiates.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
import torch

from benchmarks.baselines import Baseline, Methods, Urdf
from benchmarks.baselines.marginal_likelihood import maximise
from benchmarks.baselines.rigid_body import chosen_features, known_chain, RigidBodyFeatures
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.kernels import JointBasis
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.model import TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

ITERATIONS = 100
INITIAL_NOISE = 1e-2  # variances, in units of the torque's
NOISE_FLOOR = 1e-8
DEGREE = 2
"""Of the geometrically inspired polynomial in the position of each joint."""


class Motion(NamedTuple):
    """Positions, velocities, accelerations, each (N, n)."""

    q: Array
    dq: Array
    ddq: Array

    @classmethod
    def of(cls, dataset: Dataset) -> Motion:
        """Return the motion of a data set."""
        return cls(dataset.q, dataset.dq, dataset.ddq)


class Term(Protocol):
    """One summand of the covariance of a joint's torque."""

    def features(self, motion: Motion) -> Array:
        """Return the features of N motions, shape (N, d)."""

    def initial_guess(self, features: Array) -> Array:
        """Return initial log-hyperparameters (p,), for torques of unit variance."""

    def gram(self, theta: torch.Tensor, x: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
        """Return the covariance (N, M) of features (N, d) and (M, d)."""


@dataclass(frozen=True)
class SquaredExponential:
    """
    The universal kernel, with a length scale for every feature (paper, eq. K-SE).

    Features: cos q and sin q of revolute joints and q of prismatic ones, dq, ddq.

    """

    basis: JointBasis

    def features(self, motion: Motion) -> Array:
        """Return the features of all joints, shape (N, about 4 n)."""
        f, _ = self.basis.features(motion.q)
        return np.hstack([f[0].T, f[1][~self.basis.prismatic].T, motion.dq, motion.ddq])

    def initial_guess(self, features: Array) -> Array:
        """Return a guess: unit variance and lengths at which typical samples are correlated."""
        deviation = features.std(axis=0)
        lengths = np.sqrt(features.shape[1]) * np.where(deviation > 0, deviation, 1.0)
        return np.log(np.concatenate([[1.0], lengths]))

    def gram(self, theta: torch.Tensor, x: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
        """Return lambda exp(-|x - z|^2 / 2) in units of the length scales."""
        x, z = x * torch.exp(-theta[1:]), z * torch.exp(-theta[1:])
        product = x @ z.T
        both = x.square().sum(1)[:, None] + z.square().sum(1)
        return torch.exp(theta[0] - 0.5 * (both - 2.0 * product).clamp_min(0.0))


@dataclass(frozen=True)
class GeometricPolynomial:
    r"""
    The geometrically inspired polynomial kernel (Dalla Libera and Carli, RA-L 2020).

    .. math:: k = k^{(1)}_{av} \prod_{b} k^{(2)}_{b}

    A joint's torque is linear in ddq and in the products dq_i dq_j (a_v), gravity being the
    constant, and of degree two in (cos q_b, sin q_b) or q_b of each joint. Factors of degree p are
    products of p linear kernels, each with weights of its own (multiplicative polynomial kernel).

    """

    basis: JointBasis

    def features(self, motion: Motion) -> Array:
        """Return f_1, f_2 of every joint, then ddq and the products of velocities."""
        f, _ = self.basis.features(motion.q)
        rows, columns = np.triu_indices(self.basis.n_joints)
        products = motion.dq[:, rows] * motion.dq[:, columns]
        return np.hstack([f[0].T, f[1].T, motion.ddq, products])

    def initial_guess(self, features: Array) -> Array:
        """Return a guess: factors of about one."""
        n = self.basis.n_joints
        geometry = np.full(DEGREE * 3 * n, np.log(0.5))
        return np.concatenate([geometry, [0.0], equal_shares(features[:, 2 * n :])])

    def gram(self, theta: torch.Tensor, x: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
        """Return the product of the factors of all joints and of the linear one."""
        n = self.basis.n_joints
        weights = torch.exp(theta)
        geometry = weights[: DEGREE * 3 * n].reshape(DEGREE, n, 3)
        moving = weights[DEGREE * 3 * n :]
        product = moving[0] + (x[:, 2 * n :] * moving[1:]) @ z[:, 2 * n :].T
        for b in range(n):
            first = x[:, b, None] * z[None, :, b]
            second = x[:, n + b, None] * z[None, :, n + b]
            for offset, one, other in geometry[:, b]:
                product = product * (offset + one * first + other * second)
        return product


@dataclass(frozen=True)
class Linear:
    """phi(x) Gamma phi(z)^T with a diagonal Gamma (paper, eq. K-SP and kernel_epsilon)."""

    phi: Callable[[Motion], Array]

    def features(self, motion: Motion) -> Array:
        """Return phi, shape (N, d)."""
        return self.phi(motion)

    def initial_guess(self, features: Array) -> Array:
        """Return a guess: features that contribute equally."""
        return equal_shares(features)

    def gram(self, theta: torch.Tensor, x: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
        """Return the weighted product of the features."""
        return (x * torch.exp(theta)) @ z.T


def equal_shares(features: Array) -> Array:
    """Return logarithms of weights with which features (N, d) contribute equally, (d,)."""
    power = np.mean(np.square(features), axis=0) * features.shape[1]
    return -np.log(np.where(power > 0, power, 1.0))


def rigid_body(features: RigidBodyFeatures, joint: int) -> Linear:
    """Return a term of one joint's row of the regressor."""
    return Linear(lambda motion: np.asarray(features.torque(*motion)[:, joint]))


def friction(joint: int) -> Linear:
    """Return viscous and Coulomb friction of a joint (paper, eq. kernel_epsilon)."""
    return Linear(lambda m: np.column_stack([m.dq[:, joint], np.sign(m.dq[:, joint])]))


@dataclass(frozen=True)
class SingleOutput:
    """
    One Gaussian process per joint; hyperparameters of the largest marginal posterior.

    `urdf` adds a term that is linear in the rigid-body regressor (paper, eq. K-SP), `friction` one
    where the settings ask for friction.

    """

    term: Callable[[JointBasis], Term]
    friction: bool = False
    urdf: Urdf | None = None
    iterations: int = ITERATIONS

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> PerJoint:
        """Fit the joints one after another."""
        few = dataset.select(dataset.covering(settings.subset))
        many = dataset.select(dataset.covering(settings.max_samples))
        joints = []
        for joint, terms in enumerate(self._terms(dataset, settings)):
            stage = f'hyperparameters of {dataset.joint_names[joint]}'
            covariance = Sum(terms, joint)
            theta = covariance.optimised(
                few, self.iterations, settings.prior_precision, partial(progress, stage)
            )
            joints.append(covariance.conditioned(theta, many))
        return PerJoint(dataset, joints)

    def _terms(self, dataset: Dataset, settings: FitSettings) -> list[list[Term]]:
        """Return the summands of the covariance of each joint."""
        basis = JointBasis.of(dataset.joint_types, dataset.q)
        found: list[list[Term]] = [[] for _ in dataset.joint_names]
        for joint, terms in enumerate(found):
            terms.append(self.term(basis))
            if settings.friction and self.friction:
                terms.append(friction(joint))
        if self.urdf is not None:
            rigid = chosen_features(known_chain(self.urdf, dataset), dataset)
            for joint, terms in enumerate(found):
                terms.insert(0, rigid_body(rigid, joint))
        return found


METHODS: Methods = {
    'se': lambda _: SingleOutput(SquaredExponential),
    'gip': lambda _: SingleOutput(GeometricPolynomial, friction=True),
    'semiparametric': lambda urdf: SingleOutput(SquaredExponential, urdf=urdf),
}


@dataclass(frozen=True)
class Sum:
    """The covariance of one joint's torque, in units of its variance: a sum of terms."""

    terms: Sequence[Term]
    joint: int

    def features(self, motion: Motion) -> list[torch.Tensor]:
        """Return the features of each term."""
        found = [term.features(motion) for term in self.terms]
        return [torch.from_numpy(np.ascontiguousarray(x)) for x in found]

    def gram(
        self, theta: torch.Tensor, x: Sequence[torch.Tensor], z: Sequence[torch.Tensor]
    ) -> torch.Tensor:
        """Return the sum of the terms, shape (N, M), for all hyperparameters in one vector."""
        sizes = [len(term.initial_guess(b.numpy())) for term, b in zip(self.terms, z, strict=True)]
        thetas = torch.split(theta[: sum(sizes)], sizes)
        parts = zip(self.terms, thetas, x, z, strict=True)
        total: torch.Tensor = sum(term.gram(of, a, b) for term, of, a, b in parts)
        return total

    def optimised(
        self,
        dataset: Dataset,
        iterations: int,
        prior_precision: float,
        report: Callable[[int, int], None],
    ) -> Array:
        """Return the hyperparameters of the terms, then the logarithm of the noise's variance."""
        x = self.features(Motion.of(dataset))
        y, _, _ = self._standardised(dataset)
        guesses = [term.initial_guess(a.numpy()) for term, a in zip(self.terms, x, strict=True)]
        start = np.concatenate([*guesses, [np.log(INITIAL_NOISE)]])
        precision = np.full(start.size, prior_precision)
        precision[-1] = 0.0  # the noise has no prior

        def noisy_gram(vector: torch.Tensor) -> torch.Tensor:
            noise = torch.exp(vector[-1]) + NOISE_FLOOR
            return self.gram(vector, x, x) + noise * torch.eye(len(y), dtype=torch.float64)

        return maximise(noisy_gram, y, start, iterations, report, precision)

    def conditioned(self, vector: Array, dataset: Dataset) -> Posterior:
        """Return the posterior, given samples."""
        x = self.features(Motion.of(dataset))
        y, mean, scale = self._standardised(dataset)
        theta = torch.from_numpy(vector)
        gram = self.gram(theta, x, x).numpy()
        gram[np.diag_indices_from(gram)] += np.exp(vector[-1]) + NOISE_FLOOR
        alpha = scale * CholeskyFactor.of(gram).solve(y)
        return Posterior(self, theta, x, torch.from_numpy(alpha), mean)

    def _standardised(self, dataset: Dataset) -> tuple[Array, float, float]:
        tau = dataset.tau[:, self.joint]
        mean, scale = float(tau.mean()), float(tau.std()) or 1.0
        return (tau - mean) / scale, mean, scale


@dataclass(frozen=True)
class Posterior:
    """Posterior of one joint's torque."""

    covariance: Sum
    theta: torch.Tensor
    features: list[torch.Tensor]
    alpha: torch.Tensor
    mean: float

    @property
    def size(self) -> int:
        """Number of numbers that it keeps; the noise is none of them."""
        return sum(int(x.numel()) for x in (self.theta, *self.features, self.alpha)) - 1

    def torque(self, motion: Motion) -> Array:
        """Return the posterior mean [N m or N], shape (N,)."""
        here = self.covariance.features(motion)
        with torch.no_grad():
            found = self.covariance.gram(self.theta, here, self.features) @ self.alpha
        return self.mean + np.asarray(found.numpy())


class PerJoint(Baseline):
    """A posterior for each joint."""

    def __init__(self, data: Dataset, joints: Sequence[Posterior]) -> None:
        super().__init__(data.joint_names, data.joint_types)
        self._joints = tuple(joints)

    @property
    def size(self) -> int:
        """Number of numbers that the model keeps."""
        return sum(joint.size for joint in self._joints)

    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        """Return torques; the model has no energies."""
        motion = Motion(q, dq, ddq)
        tau = np.column_stack([joint.torque(motion) for joint in self._joints])
        return TorquePrediction(tau, None, None)
