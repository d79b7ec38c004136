"""Fit a Gaussian process to a data set: choose samples, optimise hyperparameters, condition."""

from __future__ import annotations

from dataclasses import dataclass
import time
from typing import Any

import numpy as np

from lip_id_ros.dataset import Dataset
from lip_id_ros.gp.conditioning import conditioned
from lip_id_ros.gp.initialisation import (
    initial_guesses,
    InitialGuess,
    make_friction,
    with_likely_sign_widths,
)
from lip_id_ros.gp.likelihood import MarginalLikelihood
from lip_id_ros.gp.training import maximise, Objective, Optimum
from lip_id_ros.kernels import (
    FAMILY,
    Hyperparameters,
    JointBasis,
    TorqueKernel,
    TorquePosterior,
)
from lip_id_ros.kernels.program import without_potential
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
