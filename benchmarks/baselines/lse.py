"""A squared-exponential prior on the Lagrangian (Cheng and Huang 2016; LSE in the paper)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from benchmarks.baselines import Baseline, Methods
from benchmarks.baselines.lse_kernel import energy_gram, Lengths, States, torque_gram
from benchmarks.baselines.marginal_likelihood import maximise
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.kernels import JointBasis
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.model import TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

ITERATIONS = 150  # 60 ended before it converged
BLOCK = 50  # samples answered at once
INITIAL_NOISE = 1e-2  # variance, relative to the torque's
NOISE_FLOOR = 1e-8
INITIAL_FRICTION = 1e-2


@dataclass(frozen=True)
class Lse:
    """One Gaussian process for all torques, which share a Lagrangian; and friction per joint."""

    iterations: int = ITERATIONS

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> LagrangianModel:
        """Fit all joints together."""
        basis = JointBasis.of(dataset.joint_types, dataset.q)
        few = dataset.select(dataset.covering(settings.subset))
        many = dataset.select(dataset.covering(settings.max_samples))
        start = LseHyperparameters.initial_guess(basis, dataset, with_friction=settings.friction)
        x, tau = _states(basis, few), few.tau.ravel()

        def noisy_gram(theta: torch.Tensor) -> torch.Tensor:
            gram = start.like(theta).gram(x, x).reshape(tau.size, tau.size)
            return gram + torch.diag(start.like(theta).noise(few.n_samples))

        report = partial(progress, 'hyperparameters')
        found = maximise(noisy_gram, tau, start.vector.numpy(), self.iterations, report)
        return LagrangianModel(
            dataset.joint_names, basis, start.like(torch.from_numpy(found)), many
        )


@dataclass(frozen=True)
class LseHyperparameters:
    """
    Logarithms of all hyperparameters in one vector, shape (p,).

    Variance of the Lagrangian, length scales of f_1, f_2 and dq, noise variance, and, with
    friction, variances of its viscous and Coulomb part; each of the latter per joint.
    `torque_variance`, shape (n,), is the unit of the noise floor [N^2 m^2 or N^2].

    """

    vector: torch.Tensor
    n_joints: int
    torque_variance: torch.Tensor

    @classmethod
    def initial_guess(
        cls, basis: JointBasis, dataset: Dataset, with_friction: bool
    ) -> LseHyperparameters:
        """Start from long length scales and little noise, in the units of the data."""
        f, _ = basis.features(dataset.q)
        spread = np.concatenate([f[0], f[1], dataset.dq.T]).std(axis=1)
        lengths = np.sqrt(2.0 * basis.n_joints) * np.where(spread > 0, spread, 1.0)
        variance = dataset.tau.var(axis=0)
        parts = [np.zeros(1), np.log(lengths), np.log(INITIAL_NOISE * variance)]
        if with_friction:
            speed = np.mean(np.square(dataset.dq), axis=0)
            small = INITIAL_FRICTION * variance
            parts += [np.log(small / np.where(speed > 0, speed, 1.0)), np.log(small)]
        unscaled = cls(
            torch.from_numpy(np.concatenate(parts)), basis.n_joints, torch.from_numpy(variance)
        )
        return unscaled._scaled_to(_states(basis, dataset.select(dataset.covering(BLOCK))))

    def like(self, vector: torch.Tensor) -> LseHyperparameters:
        """Return others of the same meaning."""
        return LseHyperparameters(vector, self.n_joints, self.torque_variance)

    @property
    def variance(self) -> torch.Tensor:
        """Variance of the Lagrangian [J^2]."""
        return torch.exp(self.vector[0])

    @property
    def lengths(self) -> Lengths:
        """Length scales of the features."""
        scales = torch.exp(self.vector[1 : 1 + 3 * self.n_joints]).reshape(3, self.n_joints)
        return Lengths(scales[:2], scales[2])

    def noise(self, n_samples: int) -> torch.Tensor:
        """Return the variance of every measurement, shape (N n,)."""
        begin = 1 + 3 * self.n_joints
        variance = torch.exp(self.vector[begin : begin + self.n_joints])
        return (variance + NOISE_FLOOR * self.torque_variance).repeat(n_samples)

    def gram(self, x: States, z: States) -> torch.Tensor:
        """Return the covariance of torques without noise, shape (N, n, M, n)."""
        gram = self.variance * torque_gram(x, z, self.lengths)
        if len(self.vector) > 1 + 4 * self.n_joints:
            gram = gram + torch.diag_embed(self._friction(x, z)).permute(0, 2, 1, 3)
        return gram

    def _friction(self, x: States, z: States) -> torch.Tensor:
        viscous, coulomb = torch.exp(self.vector[1 + 4 * self.n_joints :]).reshape(2, -1)
        return viscous * x.dq[:, None] * z.dq + coulomb * torch.sign(x.dq)[:, None] * torch.sign(
            z.dq
        )

    def _scaled_to(self, x: States) -> LseHyperparameters:
        # The Lagrangian varies so much that its torques vary as those of the data.
        diagonal = torch.einsum('ijij->ij', torque_gram(x, x, self.lengths)).mean(0)
        vector = self.vector.clone()
        vector[0] = (self.torque_variance / diagonal).log().mean()
        return self.like(vector)


class LagrangianModel(Baseline):
    """Posterior of torques and Lagrangian, given M samples."""

    has_potential = True

    def __init__(
        self,
        joint_names: tuple[str, ...],
        basis: JointBasis,
        hyperparameters: LseHyperparameters,
        dataset: Dataset,
    ) -> None:
        super().__init__(joint_names, basis.joint_types)
        self._basis, self._hyperparameters = basis, hyperparameters
        self._states, tau = _states(basis, dataset), dataset.tau.ravel()
        with torch.no_grad():
            gram = hyperparameters.gram(self._states, self._states).reshape(tau.size, tau.size)
            gram.diagonal().add_(hyperparameters.noise(dataset.n_samples))
        alpha = CholeskyFactor.of(gram.contiguous().numpy()).solve(tau)
        self._alpha = torch.from_numpy(alpha.reshape(dataset.tau.shape))

    @property
    def size(self) -> int:
        """Number of numbers that the model keeps."""
        return int(4 * self._alpha.numel() + self._hyperparameters.vector.numel())

    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        """
        Return torques, and the energies of the Lagrangian.

        V(q) = -L(q, 0), and T is the even part of L + V in dq. A total derivative dF(q)/dt added
        to a Lagrangian changes no torque, so the odd part is arbitrary; the paper keeps it,
        T = L + V, and finds T useless (comparison.md).

        """
        blocks = [slice(begin, begin + BLOCK) for begin in range(0, len(q), BLOCK)]
        tau = [self._torque(q[rows], dq[rows], ddq[rows]) for rows in blocks]
        forth, back, at_rest = (
            np.concatenate([self._lagrangian(q[rows], sign * dq[rows]) for rows in blocks])
            for sign in (1.0, -1.0, 0.0)
        )
        return TorquePrediction(np.concatenate(tau), (forth + back) / 2 - at_rest, -at_rest)

    def _torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        here = States.of(self._basis, q, dq, ddq)
        with torch.no_grad():
            gram = self._hyperparameters.gram(here, self._states)
            return np.asarray(torch.einsum('injm,jm->in', gram, self._alpha).numpy())

    def _lagrangian(self, q: Array, dq: Array) -> Array:
        here = States.of(self._basis, q, dq, np.zeros_like(q))
        known = self._hyperparameters
        with torch.no_grad():
            gram = known.variance * energy_gram(here, self._states, known.lengths)
            return np.asarray(torch.einsum('ijm,jm->i', gram, self._alpha).numpy())


def _states(basis: JointBasis, dataset: Dataset) -> States:
    return States.of(basis, dataset.q, dataset.dq, dataset.ddq)


METHODS: Methods = {'lse': lambda _: Lse()}
