"""The marginal likelihood of measured torques and its gradient (maths.md, section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import Hyperparameters, JointStates, TorqueKernel, TorquePrior
from lip_id_ros.kernels.gram import contracted_gradient
from lip_id_ros.kernels.torque_process import friction_gradient
from lip_id_ros.linear_algebra import CholeskyFactor


class Likelihood(Protocol):
    """What the optimisation needs of a likelihood."""

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """Return the negative logarithm at log-hyperparameters (p,), and its gradient (p,)."""


@dataclass(frozen=True)
class MarginalLikelihood:
    """
    Negative log marginal likelihood of torques (N, n) as a function of the log-hyperparameters.

    `like` gives their shapes.
    """

    kernel: TorqueKernel
    states: JointStates
    tau: Array
    like: Hyperparameters

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """
        Evaluate at log-hyperparameters (p,), constant included; the gradient has shape (p,).

        FitError if the Gram matrix cannot be factorised.
        """
        at = self.like.with_vector(vector)
        prior = TorquePrior(self.kernel, at)
        factor = CholeskyFactor.of(prior.noisy_gram(self.states))
        y = self.tau.ravel()
        alpha = factor.solve(y)
        constant = 0.5 * len(y) * np.log(2.0 * np.pi)
        value = 0.5 * float(y @ alpha) + 0.5 * factor.log_determinant() + constant
        contraction = factor.inverse()
        contraction -= np.multiply.outer(alpha, alpha)
        contraction *= 0.5
        return value, at.log_gradient(self._gradient(at, contraction))

    def _gradient(self, at: Hyperparameters, contraction: Array) -> Hyperparameters:
        n = self.tau.shape[1]
        weights = contracted_gradient(
            self.kernel.energy, at.weights, self.states.packed, contraction
        )
        blocks = np.stack([contraction[i::n, i::n] for i in range(n)])
        features = self.states.friction
        friction = None if features is None else friction_gradient(features, blocks)
        return Hyperparameters(weights, friction, np.einsum('itt->i', blocks))
