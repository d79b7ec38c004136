"""The marginal likelihood of measured torques and its gradient (docs/maths.md, section 5)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.gp.log_vector import from_vector, to_log_gradient
from lip_id_ros.kernels import Hyperparameters, JointStates, TorqueKernel, TorquePrior
from lip_id_ros.kernels.gradient import contracted_gradient
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
        jointwise = tuple(
            kernel.gradient(parameters, inputs, blocks)
            for kernel, parameters, inputs in zip(
                self.kernel.jointwise, at.jointwise, self.states.jointwise, strict=True
            )
        )
        noise = np.einsum('itt->i', blocks)
        return Hyperparameters(weights, jointwise, noise)
