"""The marginal likelihood of measured torques and its gradient (docs/maths.md, section 5)."""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.gp.log_vector import from_vector, to_log_gradient
from lip_id_ros.kernels import Hyperparameters, JointStates, TorqueKernel, TorquePrior, Weights
from lip_id_ros.kernels.gram import contracted_gradient
from lip_id_ros.kernels.per_joint import own_joint_columns
from lip_id_ros.linear_algebra import CholeskyFactor


class Likelihood(Protocol):
    """What the optimisation needs of a likelihood."""

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """Return the negative logarithm at log-hyperparameters (p,), and its gradient (p,)."""


@dataclass(frozen=True)
class MarginalLikelihood:
    """
    Negative log marginal likelihood as a function of the log-hyperparameters.

    Attributes
    ----------
    kernel : TorqueKernel
    states : JointStates
        N samples.
    tau : array, shape (N, n)
        Measured torques [N m or N].
    like : Hyperparameters
        Gives the shapes.

    """

    kernel: TorqueKernel
    states: JointStates
    tau: Array
    like: Hyperparameters

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """
        Evaluate at one vector of log-hyperparameters, shape (p,).

        Returns
        -------
        value : float
            Negative log marginal likelihood, constant included.
        gradient : array, shape (p,)

        Raises
        ------
        FitError
            If the Gram matrix cannot be factorised.

        """
        at = from_vector(vector, self.like)
        prior = TorquePrior(self.kernel, at)
        factor = CholeskyFactor.of(prior.noisy_gram(self.states))
        y = self.tau.ravel()
        alpha = factor.solve(y)
        constant = 0.5 * len(y) * np.log(2.0 * np.pi)
        value = 0.5 * float(y @ alpha) + 0.5 * factor.log_determinant() + constant
        contraction = factor.inverse()
        contraction -= np.multiply.outer(alpha, alpha)
        contraction *= 0.5
        return value, to_log_gradient(self._gradient(at, contraction), at)

    def _gradient(self, at: Hyperparameters, contraction: Array) -> Hyperparameters:
        n = self.tau.shape[1]
        weights = contracted_gradient(
            self.kernel.energy, at.weights, self.states.packed, contraction
        )
        blocks = np.stack([contraction[i::n, i::n] for i in range(n)])
        per_joint = tuple(
            kernel.gradient(parameters, inputs, blocks)
            for kernel, parameters, inputs in zip(
                self.kernel.per_joint, at.per_joint, self.states.per_joint, strict=True
            )
        )
        noise = np.einsum('itt->i', blocks)
        return Hyperparameters(weights, per_joint, noise)


@dataclass(frozen=True)
class LinearLikelihood:
    """
    What `MarginalLikelihood` computes, by the lemmas of Woodbury and of the determinant.

    With K = F S F^T for features F of links and friction, and S of their prior variances, the
    inverse of K + noise follows from matrices of the number of features; no Gram matrix is formed.

    Attributes
    ----------
    kernel : TorqueKernel
        Links and friction alone, see its `is_linear`.
    states : JointStates
        N samples.
    tau : array, shape (N, n)
        Measured torques [N m or N].
    like : Hyperparameters
        Gives the shapes.

    """

    kernel: TorqueKernel
    states: JointStates
    tau: Array
    like: Hyperparameters
    _features: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Gather the features, shape (N n, k)."""
        friction = (
            own_joint_columns(inputs).reshape(self.tau.size, -1)
            for inputs in self.states.per_joint
        )
        features = np.hstack([*self.states.links, *friction])
        object.__setattr__(self, '_features', features)

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """
        Evaluate at one vector of log-hyperparameters, shape (p,).

        Returns
        -------
        value : float
            Negative log marginal likelihood, constant included.
        gradient : array, shape (p,)

        Raises
        ------
        FitError
            If the data or the hyperparameters are not finite.

        """
        at = from_vector(vector, self.like)
        features, y = self._features, self.tau.ravel()
        noise = np.tile(at.noise_variance, len(self.states))
        deviations = np.sqrt(self._variances(at))
        weighted = features / noise[:, None]
        products = features.T @ weighted
        # Without noise the products outgrow the identity: then a little jitter is added.
        factor = CholeskyFactor.of(
            np.eye(len(products)) + products * np.outer(deviations, deviations)
        )
        projected = deviations * (weighted.T @ y)
        coefficients = deviations * factor.solve(projected)
        alpha = y / noise - weighted @ coefficients
        half = factor.half_solve(deviations[:, None] * products)
        inner = np.diagonal(products) - np.square(half).sum(axis=0)
        rows = factor.half_solve(deviations[:, None] * weighted.T)
        diagonal = 1.0 / noise - np.square(rows).sum(axis=0)
        determinant = 0.5 * (factor.log_determinant() + np.log(noise).sum())
        value = 0.5 * y @ alpha + determinant + 0.5 * len(y) * np.log(2.0 * np.pi)
        by_variance = 0.5 * (inner - np.square(features.T @ alpha))
        by_noise = 0.5 * (diagonal - np.square(alpha)).reshape(self.tau.shape).sum(axis=0)
        return float(value), to_log_gradient(self._gradient(at, by_variance, by_noise), at)

    def _variances(self, at: Hyperparameters) -> Array:
        links = [np.ones(features.shape[1]) for features in self.states.links]
        return np.concatenate([*links, *(variances.ravel() for variances in at.per_joint)])

    def _gradient(
        self, at: Hyperparameters, by_variance: Array, by_noise: Array
    ) -> Hyperparameters:
        start = sum(features.shape[1] for features in self.states.links)
        per_joint = []
        for variances in at.per_joint:
            per_joint.append(by_variance[start : start + variances.size].reshape(variances.shape))
            start += variances.size
        weights = Weights(*(np.zeros_like(values) for values in at.weights))
        return Hyperparameters(weights, tuple(per_joint), by_noise)


class MakeLikelihood(Protocol):
    """Makes a likelihood of N samples with torques tau, shape (N, n)."""

    def __call__(
        self, kernel: TorqueKernel, states: JointStates, tau: Array, like: Hyperparameters
    ) -> Likelihood:
        """Return the likelihood; `like` gives the shapes of the hyperparameters."""


@dataclass(frozen=True)
class Backend:
    """
    What evaluates the likelihood.

    Attributes
    ----------
    device : str
        'cpu' or 'cuda'.
    likelihood : callable
    note : str
        Why this is not the device that was asked for; empty where it is.

    """

    device: str
    likelihood: MakeLikelihood
    note: str = ''


def choose(device: str) -> Backend:
    """
    Return what evaluates the likelihood on a device, or on the CPU where that is missing.

    Parameters
    ----------
    device : str
        'cpu' or 'cuda'.

    """
    if device == 'cpu':
        return Backend('cpu', MarginalLikelihood)
    try:
        reference = import_module('lip_id_ros.gp.reference')
    except ImportError as error:
        return _instead(device, f'torch cannot be imported ({error})')
    if not reference.is_available():
        return _instead(device, 'torch finds no CUDA device')
    return Backend(device, reference.likelihood_on(device))


def _instead(device: str, reason: str) -> Backend:
    note = f'Fitted on the CPU instead of {device}: {reason}.'
    return Backend('cpu', MarginalLikelihood, note)
