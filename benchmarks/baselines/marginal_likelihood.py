"""Maximum marginal likelihood of a Gaussian process whose Gram matrix torch can differentiate."""

from __future__ import annotations

from collections.abc import Callable

import torch

from lip_id_ros.arrays import Array
from lip_id_ros.errors import FitError
from lip_id_ros.gp.training import minimise

NoisyGram = Callable[[torch.Tensor], torch.Tensor]
"""From log-hyperparameters (p,) to the covariance of the measurements (m, m)."""

NOT_POSITIVE = (
    'the Gram matrix was expected to be positive definite but is not: samples are probably '
    'repeated; use fewer, better spread samples.'
)


def maximise(
    noisy_gram: NoisyGram,
    y: Array,
    start: Array,
    iterations: int,
    report: Callable[[int, int], None],
    precision: Array | float = 0.0,
) -> Array:
    """
    Return the log-hyperparameters, shape (p,), of the largest marginal likelihood or posterior.

    `y`, shape (m,), are measurements of zero prior mean. `start` is also the centre of a Gaussian
    prior of some precision. FitError if the Gram matrix cannot be factorised at the start.

    """
    measured, centre = torch.tensor(y), torch.tensor(start)

    def value_and_gradient(vector: Array) -> tuple[float, Array]:
        theta = torch.tensor(vector, requires_grad=True)
        factor, failed = torch.linalg.cholesky_ex(noisy_gram(theta))
        if failed or not bool(torch.isfinite(factor).all()):
            raise FitError(NOT_POSITIVE)
        half = torch.linalg.solve_triangular(factor, measured[:, None], upper=False)
        value = 0.5 * half.square().sum() + factor.diagonal().log().sum()
        value = value + 0.5 * (torch.as_tensor(precision) * (theta - centre).square()).sum()
        value.backward()
        return float(value.detach()), theta.grad.numpy().copy()

    return minimise(value_and_gradient, start, start, iterations, report).vector
