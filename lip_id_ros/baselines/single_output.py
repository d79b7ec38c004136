"""A Gaussian process for every joint's torque by itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from lip_id_ros.arrays import Array
from lip_id_ros.baselines.interface import Answer
from lip_id_ros.baselines.marginal_likelihood import maximise
from lip_id_ros.baselines.samples import covering
from lip_id_ros.baselines.terms import MakeTerm, Motion, Term
from lip_id_ros.dataset import Dataset
from lip_id_ros.kernels import JointBasis
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

ITERATIONS = 100
NOISE_START = 1e-2  # variances, in units of the torque's
NOISE_FLOOR = 1e-8


class SingleOutput:
    """
    One Gaussian process per joint; hyperparameters by maximum marginal likelihood.

    Parameters
    ----------
    terms : sequence of callables
        Make the summands of a joint's covariance.
    friction : callable, optional
        Makes one more where the settings ask for friction.
    iterations : int
        Most iterations per joint.

    """

    def __init__(
        self,
        terms: Sequence[MakeTerm],
        friction: MakeTerm | None = None,
        iterations: int = ITERATIONS,
    ) -> None:
        self._terms = tuple(terms)
        self._friction = friction
        self._iterations = iterations

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> PerJoint:
        """Fit the joints one after another."""
        terms = self._terms
        if settings.friction and self._friction is not None:
            terms = (*terms, self._friction)
        basis = JointBasis.of(dataset.joint_types, dataset.q)
        few = covering(dataset, basis, settings.subset)
        many = covering(dataset, basis, settings.max_samples)
        joints = []
        for joint, name in enumerate(dataset.joint_names):
            covariance = Sum([make(basis, joint) for make in terms], joint)
            theta = _optimise(covariance, few, self._iterations, progress, name)
            joints.append(_condition(covariance, theta, many))
        return PerJoint(joints)


class Sum:
    """
    The covariance of one joint's torque, in units of its variance.

    Parameters
    ----------
    terms : sequence of Term
    joint : int

    """

    def __init__(self, terms: Sequence[Term], joint: int) -> None:
        self._terms = tuple(terms)
        self.joint = joint

    def features(self, motion: Motion) -> list[torch.Tensor]:
        """Return the features of each term."""
        found = [term.features(motion) for term in self._terms]
        return [torch.from_numpy(np.ascontiguousarray(x)) for x in found]

    def start(self, features: Sequence[torch.Tensor]) -> list[Array]:
        """Return where the hyperparameters of each term start."""
        return [term.start(x.numpy()) for term, x in zip(self._terms, features, strict=True)]

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
class Fitted:
    """Posterior of one joint's torque."""

    covariance: Sum
    thetas: list[torch.Tensor]
    features: list[torch.Tensor]
    alpha: torch.Tensor
    mean: float

    @property
    def size(self) -> int:
        """How many numbers it keeps."""
        kept = (*self.thetas, *self.features, self.alpha)
        return sum(int(x.numel()) for x in kept)

    def torque(self, motion: Motion) -> Array:
        """Return the posterior mean [N m or N], shape (N,)."""
        here = self.covariance.features(motion)
        with torch.no_grad():
            found = self.covariance.gram(self.thetas, here, self.features) @ self.alpha
        return self.mean + np.asarray(found.numpy())


class PerJoint:
    """
    Estimates of all joints, each by itself.

    Parameters
    ----------
    joints : sequence of Fitted

    """

    def __init__(self, joints: Sequence[Fitted]) -> None:
        self._joints = tuple(joints)
        self.size = sum(joint.size for joint in joints)

    def predict(self, q: Array, dq: Array, ddq: Array) -> Answer:
        """Estimate torques; energies are not in this model."""
        motion = Motion(q, dq, ddq)
        return Answer(np.column_stack([joint.torque(motion) for joint in self._joints]))


def _optimise(
    covariance: Sum, dataset: Dataset, iterations: int, progress: Progress, name: str
) -> Array:
    x = covariance.features(Motion(dataset.q, dataset.dq, dataset.ddq))
    y, _, _ = _standardised(dataset.tau[:, covariance.joint])
    parts = covariance.start(x)
    start = np.concatenate([*parts, [np.log(NOISE_START)]])

    def noisy_gram(vector: torch.Tensor) -> torch.Tensor:
        gram = covariance.gram(_split(vector, parts), x, x)
        return gram + (torch.exp(vector[-1]) + NOISE_FLOOR) * torch.eye(
            len(y), dtype=torch.float64
        )

    return maximise(noisy_gram, y, start, iterations, progress, f'hyperparameters of {name}')


def _condition(covariance: Sum, vector: Array, dataset: Dataset) -> Fitted:
    x = covariance.features(Motion(dataset.q, dataset.dq, dataset.ddq))
    y, mean, scale = _standardised(dataset.tau[:, covariance.joint])
    thetas = _split(torch.from_numpy(vector), covariance.start(x))
    gram = covariance.gram(thetas, x, x).numpy()
    gram[np.diag_indices_from(gram)] += np.exp(vector[-1]) + NOISE_FLOOR
    alpha = scale * CholeskyFactor.of(gram).solve(y)
    return Fitted(covariance, thetas, x, torch.from_numpy(alpha), mean)


def _standardised(tau: Array) -> tuple[Array, float, float]:
    mean, scale = float(tau.mean()), float(tau.std()) or 1.0
    return (tau - mean) / scale, mean, scale


def _split(vector: torch.Tensor, parts: Sequence[Array]) -> list[torch.Tensor]:
    sizes = [len(part) for part in parts]
    return list(torch.split(vector[: sum(sizes)], sizes))
