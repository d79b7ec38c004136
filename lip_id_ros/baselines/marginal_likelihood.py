"""Maximum marginal likelihood of a Gaussian process whose Gram matrix torch can differentiate."""

from __future__ import annotations

from collections.abc import Callable
import math

import numpy as np
from scipy.optimize import minimize
import torch

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import FitError
from lip_id_ros.gp.subset import spread
from lip_id_ros.kernels import JointBasis
from lip_id_ros.progress import Progress

NoisyGram = Callable[[torch.Tensor], torch.Tensor]
"""From log-hyperparameters (p,) to the covariance of the measurements (m, m)."""

RANGE = math.log(1e6)  # largest distance of a hyperparameter from its initial value
FAR_WORSE = 10.0


def covering(dataset: Dataset, basis: JointBasis, count: int) -> Dataset:
    """Return the `count` samples that cover the motion best, as our fit chooses them."""
    return dataset.select(spread(basis, dataset.q, dataset.dq, dataset.ddq, count))


def maximise(
    noisy_gram: NoisyGram,
    y: Array,
    start: Array,
    iterations: int,
    progress: Progress,
    stage: str,
) -> Array:
    """
    Return the log-hyperparameters, shape (p,), of the largest marginal likelihood.

    Parameters
    ----------
    noisy_gram : callable
    y : ndarray, shape (m,)
        Measurements of zero prior mean.
    start : ndarray, shape (p,)
    iterations : int
        Most iterations of L-BFGS.
    progress : callable
    stage : str

    Raises
    ------
    FitError
        If the Gram matrix cannot be factorised at the start.

    """
    objective = _Guarded(noisy_gram, torch.tensor(y))
    done = 0

    def report(_: Array) -> None:
        nonlocal done
        done += 1
        progress(stage, done, iterations)

    found = minimize(
        objective,
        start,
        jac=True,
        method='L-BFGS-B',
        bounds=np.column_stack([start - RANGE, start + RANGE]),
        callback=report,
        options={'maxiter': iterations, 'maxcor': 30, 'maxfun': 3 * iterations},
    )
    progress(stage, iterations, iterations)
    return np.asarray(found.x, dtype=np.float64)


class _Guarded:
    """Negative logarithm and gradient; a trial point that cannot be factorised is a bad step."""

    def __init__(self, noisy_gram: NoisyGram, y: torch.Tensor) -> None:
        self._noisy_gram = noisy_gram
        self._y = y
        self._worst: float | None = None

    def __call__(self, vector: Array) -> tuple[float, Array]:
        theta = torch.tensor(vector, requires_grad=True)
        factor, failed = torch.linalg.cholesky_ex(self._noisy_gram(theta))
        if failed or not bool(torch.isfinite(factor).all()):
            return self._bad_step(vector)
        half = torch.linalg.solve_triangular(factor, self._y[:, None], upper=False)
        value = 0.5 * half.square().sum() + factor.diagonal().log().sum()
        value.backward()
        number = float(value.detach())
        self._worst = number if self._worst is None else max(number, self._worst)
        return number, theta.grad.numpy().copy()

    def _bad_step(self, vector: Array) -> tuple[float, Array]:
        if self._worst is None:
            raise FitError(
                'the Gram matrix was expected to be positive definite at the start but is not: '
                'samples are probably repeated; use fewer, better spread samples.'
            )
        return self._worst + FAR_WORSE * (1.0 + abs(self._worst)), np.zeros_like(vector)
