"""
Condition a process on samples, with the noise and the correlation that these show.

Hyperparameters come from few samples that lie far apart: the noise of few may be too small, and
they cannot show that residuals are correlated in time, as those of low-passed torques are
(maths.md, section 5).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.dataset.subsets import contiguous_cuts
from lip_id_ros.kernels import Hyperparameters, TorqueKernel, TorquePosterior, TorquePrior
from lip_id_ros.linear_algebra import CholeskyFactor

LEFT_OUT_BLOCKS = 6
NOISE_STEPS = 5
CLOSE = 0.25
"""Change of a logarithm of noise variance that is none."""

LARGEST_STEP = np.log(30.0)
"""Change of such a logarithm at a time."""


def conditioned(
    kernel: TorqueKernel, hyperparameters: Hyperparameters, dataset: Dataset
) -> tuple[TorquePosterior, Array]:
    """
    Condition on all samples, in the order of time, with the likeliest noise variances.

    The result has shape (n,): mean squared residuals of blocks of time that are left out [(N m)^2
    or N^2]. FitError if the Gram matrix cannot be factorised.
    """
    states = kernel.states(dataset.q, dataset.dq, dataset.ddq)
    n = dataset.n_joints
    cuts = n * contiguous_cuts(dataset.segment, min(LEFT_OUT_BLOCKS, dataset.n_samples))
    for _ in range(NOISE_STEPS):
        prior = TorquePrior(kernel, hyperparameters)
        factor = CholeskyFactor.of(prior.noisy_gram(states))
        alpha = factor.solve(dataset.tau.ravel()).reshape(dataset.tau.shape)
        blocks = factor.inverse_blocks(cuts)
        step = _noise_step(alpha, blocks)
        if (np.abs(step) < CLOSE).all():
            break
        variance = hyperparameters.noise_variance * np.exp(step)
        hyperparameters = replace(hyperparameters, noise_variance=variance)
    inflation = left_out_inflation(alpha, blocks, prior.hyperparameters.noise_variance)
    left_out = np.mean(left_out_residuals(alpha, blocks) ** 2, axis=0)
    return TorquePosterior(prior, states, dataset.tau, alpha, inflation), left_out


def left_out_residuals(alpha: Array, blocks: list[Array]) -> Array:
    """
    Return the residuals of blocks of samples, each predicted by all others, (N, n).

    Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, eq. 5.12, by blocks.
    """
    ends = np.cumsum([len(block) for block in blocks])[:-1]
    parts = zip(np.split(alpha.ravel(), ends), blocks, strict=True)
    found = [CholeskyFactor.of(block).solve(part) for part, block in parts]
    return np.concatenate(found).reshape(alpha.shape)


def _noise_step(alpha: Array, blocks: list[Array]) -> Array:
    """
    Return the changes of the logarithms of the noise variances, (n,), to the likeliest.

    Where the likelihood is largest alpha has the variance (K + noise)^-1 (MacKay 1992).
    """
    expected = np.concatenate([block.diagonal() for block in blocks]).reshape(alpha.shape)
    step = np.log(np.sum(alpha**2, axis=0) / expected.sum(axis=0))
    return np.asarray(np.clip(step, -LARGEST_STEP, LARGEST_STEP))


def left_out_inflation(alpha: Array, blocks: list[Array], noise_variance: Array) -> float:
    """
    Return the factor of the variances with which left-out blocks are explained, at least 1.

    `alpha`, shape (N, n): (K + noise)^-1 tau. `blocks`: of (K + noise)^-1 on its diagonal, one for
    each contiguous block of samples. `noise_variance`, shape (n,).
    """
    noise = np.resize(noise_variance, alpha.size)
    # how far each block moves its own prediction, in the units of alpha
    moved = left_out_residuals(alpha, blocks).ravel() - noise * alpha.ravel()
    diagonal = np.concatenate([block.diagonal() for block in blocks])
    return max(1.0, float(alpha.ravel() @ moved) / (alpha.size - float(noise @ diagonal)))
