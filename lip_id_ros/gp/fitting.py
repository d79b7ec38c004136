"""
Fit processes on energies.

Hyperparameters on few samples, the posterior on all. The noise is estimated again: few samples
that lie far apart cannot show that residuals are correlated in time, as those of low-passed
torques are (maths.md, section 5).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import time
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.dataset.subsets import contiguous_cuts
from lip_id_ros.gp.initialisation import (
    initial_guesses,
    InitialGuess,
    make_friction,
    with_likely_sign_widths,
)
from lip_id_ros.gp.training import MarginalLikelihood, maximise, Objective, Optimum
from lip_id_ros.kernels import (
    FAMILY,
    Hyperparameters,
    JointBasis,
    TorqueKernel,
    TorquePosterior,
    TorquePrior,
)
from lip_id_ros.kernels.program import without_potential
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import FitSettings

LEAST_SAMPLES = 10
TRIAL_ITERATIONS = 12
CONDITIONING = 'posterior'


@dataclass(frozen=True, eq=False)
class FittedProcess:
    """A Gaussian process fitted to data, and JSON-able how the optimisation went."""

    posterior: TorquePosterior
    report: dict[str, Any]


def fit_process(
    dataset: Dataset, settings: FitSettings, kernel: str, progress: Progress = silent
) -> FittedProcess:
    """
    Fit Gaussian processes on energies and friction to a data set.

    The hyperparameters are optimised on a well-spread subset of the samples; the posterior is then
    conditioned on all of them, or on the best spread `max_samples`, whose noise is estimated
    again. The kernel is one of `lip_id_ros.kernels.FAMILY`, whatever the settings name.

    FitError if the Gram matrix cannot be factorised.
    """
    started = time.monotonic()
    torques = make_kernel(dataset, settings, kernel)
    torques, optimum = _optimise(torques, dataset, settings, progress)
    seconds = round(time.monotonic() - started, 3)
    progress(CONDITIONING, 0, 1)
    some = dataset.select(dataset.covering(settings.max_samples))
    posterior, left_out = conditioned(torques, optimum.hyperparameters, some)
    progress(CONDITIONING, 1, 1)
    variance = some.tau.var(axis=0)
    shares = left_out / np.where(variance > 0.0, variance, 1.0)
    report = {**_report(optimum, posterior), 'seconds_optimising': seconds}
    report['unexplained_left_out'] = shares.tolist()
    return FittedProcess(posterior, report)


def make_kernel(dataset: Dataset, settings: FitSettings, name: str) -> TorqueKernel:
    """Return an energy kernel, with friction where the settings ask for it."""
    energy = FAMILY[name](dataset.n_joints)
    if dataset.gravity_compensated:
        energy = without_potential(energy)
    basis = JointBasis.of(dataset.joint_types, dataset.q)
    return TorqueKernel(energy, basis, make_friction(dataset.dq) if settings.friction else None)


def _optimise(
    kernel: TorqueKernel,
    dataset: Dataset,
    settings: FitSettings,
    progress: Progress,
) -> tuple[TorqueKernel, Optimum]:
    def objective(centre: Hyperparameters, some: Dataset) -> Objective:
        states = kernel.states(some.q, some.dq, some.ddq)
        likelihood = MarginalLikelihood(kernel, states, some.tau, centre)
        return Objective(likelihood, centre, settings.prior_precision)

    few = dataset.select(dataset.covering(max(LEAST_SAMPLES, settings.subset // 3)))
    # Tried on fewer samples, so that all of them together cost less than the optimisation itself.
    tried = [
        _tried(guess, objective(guess.centre, few), settings, progress, number)
        for number, guess in enumerate(initial_guesses(kernel, dataset), start=1)
    ]
    guess, trial = min(tried, key=lambda pair: pair[1].value)
    some = dataset.select(dataset.covering(settings.subset))
    kernel = with_likely_sign_widths(kernel, trial.hyperparameters, some)
    followed = objective(guess.centre, some)
    return kernel, maximise(followed, trial.hyperparameters, settings.iterations, progress)


def _tried(
    guess: InitialGuess,
    objective: Objective,
    settings: FitSettings,
    progress: Progress,
    number: int,
) -> tuple[InitialGuess, Optimum]:
    iterations = min(TRIAL_ITERATIONS, settings.iterations)
    stage = f'start {number}'
    return guess, maximise(objective, guess.hyperparameters, iterations, progress, stage)


def _report(optimum: Optimum, posterior: TorquePosterior) -> dict[str, Any]:
    return {
        'negative_log_likelihood': optimum.negative_log_likelihood,
        'iterations': optimum.iterations,
        'converged': optimum.converged,
        'optimiser_message': optimum.message,
        'at_bounds': list(optimum.at_bounds),
        'rejected_steps': optimum.rejected,
        'noise_std': posterior.noise_std.tolist(),
        'covariance_inflation': posterior.inflation,
    }


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
