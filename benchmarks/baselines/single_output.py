"""A Gaussian process for every joint's torque by itself: SE, GIP and the semiparametric one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from benchmarks.baselines.interface import Baseline, Methods, Urdf
from benchmarks.baselines.marginal_likelihood import maximise
from benchmarks.baselines.rigid_body import chosen_features, known_chain, RigidBodyFeatures
from benchmarks.baselines.terms import Linear, Motion, Term, TERMS
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
RIGID_BODY = 'rigid_body'


@dataclass(frozen=True)
class SingleOutput:
    """
    One Gaussian process per joint; hyperparameters of the largest marginal posterior.

    Attributes
    ----------
    terms : tuple of str
        Summands of a joint's covariance: keys of `benchmarks.baselines.terms.TERMS`, and
        'rigid_body' for one that is linear in the rigid-body regressor (paper, eq. K-SP).
    friction : bool
        Whether to add a friction term where the settings ask for friction.
    urdf : path, optional
        Source of the kinematics for the term 'rigid_body'.
    iterations : int
        Most iterations per joint.

    """

    terms: tuple[str, ...]
    friction: bool = False
    urdf: Urdf | None = None
    iterations: int = ITERATIONS

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> PerJoint:
        """Fit the joints one after another."""
        names = (*self.terms, 'friction') if settings.friction and self.friction else self.terms
        basis = JointBasis.of(dataset.joint_types, dataset.q)
        terms = _Terms(names, basis, self._rigid_body(dataset))
        few = dataset.select(dataset.covering(settings.subset))
        many = dataset.select(dataset.covering(settings.max_samples))
        joints = []
        for joint, name in enumerate(dataset.joint_names):
            covariance = terms.covariance(joint)
            precision = settings.prior_precision
            theta = _optimise(covariance, few, self.iterations, precision, progress, name)
            joints.append(_condition(covariance, theta, many))
        return PerJoint(dataset.joint_names, dataset.joint_types, joints)

    def _rigid_body(self, dataset: Dataset) -> RigidBodyFeatures | None:
        if self.urdf is None:
            return None
        return chosen_features(known_chain(self.urdf, dataset), dataset)


METHODS: Methods = {
    'se': lambda _: SingleOutput(('squared_exponential',)),
    'gip': lambda _: SingleOutput(('geometric_polynomial',), friction=True),
    'semiparametric': lambda urdf: SingleOutput((RIGID_BODY, 'squared_exponential'), urdf=urdf),
}


class RigidBodyTerm(Linear):
    """A covariance that is linear in one joint's row of the regressor."""

    def __init__(self, features: RigidBodyFeatures, joint: int) -> None:
        self._features = features
        self._joint = joint

    def features(self, motion: Motion) -> Array:
        """Return the joint's rows, shape (N, 14 n)."""
        rows: Array = self._features.torque(*motion)[:, self._joint]
        return rows


@dataclass(frozen=True)
class _Terms:
    """The summands of every joint's covariance, by name."""

    names: tuple[str, ...]
    basis: JointBasis
    rigid_body: RigidBodyFeatures | None = None

    def covariance(self, joint: int) -> Sum:
        return Sum([self._term(name, joint) for name in self.names], joint)

    def _term(self, name: str, joint: int) -> Term:
        if self.rigid_body is not None and name == RIGID_BODY:
            return RigidBodyTerm(self.rigid_body, joint)
        return TERMS[name](self.basis, joint)


class Sum:
    """The covariance of one joint's torque, in units of its variance."""

    def __init__(self, terms: Sequence[Term], joint: int) -> None:
        self._terms = tuple(terms)
        self.joint = joint

    def features(self, motion: Motion) -> list[torch.Tensor]:
        """Return the features of each term."""
        found = [term.features(motion) for term in self._terms]
        return [torch.from_numpy(np.ascontiguousarray(x)) for x in found]

    def initial_guess(self, features: Sequence[torch.Tensor]) -> list[Array]:
        """Return the initial hyperparameters of each term."""
        return [
            term.initial_guess(x.numpy()) for term, x in zip(self._terms, features, strict=True)
        ]

    def gram(
        self,
        thetas: Sequence[torch.Tensor],
        x: Sequence[torch.Tensor],
        z: Sequence[torch.Tensor],
    ) -> torch.Tensor:
        """Return the sum of the terms, shape (N, M)."""
        parts = zip(self._terms, thetas, x, z, strict=True)
        total: torch.Tensor = sum(term.gram(theta, a, b) for term, theta, a, b in parts)
        return total


@dataclass(frozen=True)
class Posterior:
    """Posterior of one joint's torque."""

    covariance: Sum
    thetas: list[torch.Tensor]
    features: list[torch.Tensor]
    alpha: torch.Tensor
    mean: float

    @property
    def size(self) -> int:
        """Number of numbers that it keeps."""
        kept = (*self.thetas, *self.features, self.alpha)
        return sum(int(x.numel()) for x in kept)

    def torque(self, motion: Motion) -> Array:
        """Return the posterior mean [N m or N], shape (N,)."""
        here = self.covariance.features(motion)
        with torch.no_grad():
            found = self.covariance.gram(self.thetas, here, self.features) @ self.alpha
        return self.mean + np.asarray(found.numpy())


class PerJoint(Baseline):
    """A posterior for each joint."""

    def __init__(
        self,
        joint_names: tuple[str, ...],
        joint_types: tuple[str, ...],
        joints: Sequence[Posterior],
    ) -> None:
        super().__init__(joint_names, joint_types)
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


def _optimise(
    covariance: Sum,
    dataset: Dataset,
    iterations: int,
    prior_precision: float,
    progress: Progress,
    name: str,
) -> Array:
    x = covariance.features(Motion(dataset.q, dataset.dq, dataset.ddq))
    y, _, _ = _standardised(dataset.tau[:, covariance.joint])
    parts = covariance.initial_guess(x)
    start = np.concatenate([*parts, [np.log(INITIAL_NOISE)]])
    precision = np.full(start.size, prior_precision)
    precision[-1] = 0.0  # the noise has no prior

    def noisy_gram(vector: torch.Tensor) -> torch.Tensor:
        gram = covariance.gram(_split(vector, parts), x, x)
        return gram + (torch.exp(vector[-1]) + NOISE_FLOOR) * torch.eye(
            len(y), dtype=torch.float64
        )

    stage = f'hyperparameters of {name}'
    return maximise(noisy_gram, y, start, iterations, progress, stage, precision)


def _condition(covariance: Sum, vector: Array, dataset: Dataset) -> Posterior:
    x = covariance.features(Motion(dataset.q, dataset.dq, dataset.ddq))
    y, mean, scale = _standardised(dataset.tau[:, covariance.joint])
    thetas = _split(torch.from_numpy(vector), covariance.initial_guess(x))
    gram = covariance.gram(thetas, x, x).numpy()
    gram[np.diag_indices_from(gram)] += np.exp(vector[-1]) + NOISE_FLOOR
    alpha = scale * CholeskyFactor.of(gram).solve(y)
    return Posterior(covariance, thetas, x, torch.from_numpy(alpha), mean)


def _standardised(tau: Array) -> tuple[Array, float, float]:
    mean, scale = float(tau.mean()), float(tau.std()) or 1.0
    return (tau - mean) / scale, mean, scale


def _split(vector: torch.Tensor, parts: Sequence[Array]) -> list[torch.Tensor]:
    sizes = [len(part) for part in parts]
    return list(torch.split(vector[: sum(sizes)], sizes))
