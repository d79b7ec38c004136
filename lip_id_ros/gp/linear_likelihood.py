"""The marginal likelihood of priors that are linear in few features: no Gram matrix is formed."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.gp.log_vector import from_vector, to_log_gradient
from lip_id_ros.kernels import Hyperparameters, JointStates, TorqueKernel, Weights
from lip_id_ros.kernels.jointwise import own_joint_columns
from lip_id_ros.linear_algebra import CholeskyFactor


@dataclass(frozen=True)
class LinearLikelihood:
    """
    What `MarginalLikelihood` computes, by the lemmas of Woodbury and of the determinant.

    With K = F S F^T for features F of links and friction, and S of their prior variances, all that
    is needed of the inverse of K + noise follows from matrices of the number of features.

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
            for inputs in self.states.jointwise
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
        return np.concatenate([*links, *(variances.ravel() for variances in at.jointwise)])

    def _gradient(
        self, at: Hyperparameters, by_variance: Array, by_noise: Array
    ) -> Hyperparameters:
        start = sum(features.shape[1] for features in self.states.links)
        jointwise = []
        for variances in at.jointwise:
            jointwise.append(by_variance[start : start + variances.size].reshape(variances.shape))
            start += variances.size
        weights = Weights(*(np.zeros_like(values) for values in at.weights))
        return Hyperparameters(weights, tuple(jointwise), by_noise)
