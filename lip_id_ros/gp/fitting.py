"""From a data set to a trained model: choose samples, optimise, condition."""

from __future__ import annotations

from dataclasses import replace
import time
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.gp.initialisation import (
    from_torques,
    InitialGuess,
    INITIALISATIONS,
    make_friction,
    make_residual,
)
from lip_id_ros.gp.likelihood import Backend, choose, LinearLikelihood
from lip_id_ros.gp.sign_width import with_likely_sign_widths
from lip_id_ros.gp.subset import spread
from lip_id_ros.gp.training import maximise, Objective, Optimum
from lip_id_ros.kernels import (
    ARTICULATED,
    FAMILY,
    Hyperparameters,
    JointBasis,
    PerJointKernel,
    TorqueKernel,
    TorquePosterior,
    TorquePrior,
)
from lip_id_ros.kernels.program import EnergyKernel, POTENTIALS, recursive, without_potential
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.effort_calibration import effort_calibrations
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import FitSettings

LEAST_SAMPLES = 10
TRIAL_ITERATIONS = 12
CONDITIONING = 'posterior'
ENERGY_KERNELS = {**FAMILY, ARTICULATED: recursive}


def fit(
    dataset: Dataset, settings: FitSettings | None = None, progress: Progress = silent
) -> InverseDynamicsModel:
    """
    Fit a model to a data set.

    The hyperparameters are optimised on a well-spread subset of the samples; the posterior is
    then conditioned on all of them, or on the best spread `max_samples`.

    Parameters
    ----------
    dataset : Dataset
    settings : FitSettings, optional
    progress : callable

    Raises
    ------
    DataError
        If there are too few samples or a torque never changes.
    FitError
        If the Gram matrix cannot be factorised.

    """
    settings = settings or FitSettings()
    started = time.monotonic()
    _check(dataset)
    kernel = make_kernel(dataset, settings)
    backend = choose(settings.device)
    kernel, optimum = _optimise(kernel, dataset, settings, backend, progress)
    optimised = time.monotonic()
    progress(CONDITIONING, 0, 1)
    model = _condition(kernel, optimum, _covering(dataset, kernel, settings.max_samples))
    progress(CONDITIONING, 1, 1)
    times = {
        'seconds_optimising': round(optimised - started, 3),
        'seconds_total': round(time.monotonic() - started, 3),
    }
    place = {'device': backend.device, 'device_note': backend.note}
    return replace(
        model,
        summary={**model.summary, **_report(optimum), **times, **place},
        provenance={**dataset.provenance, 'n_samples_available': dataset.n_samples},
    )


def make_kernel(dataset: Dataset, settings: FitSettings) -> TorqueKernel:
    """Return the kernels that the settings ask for, in the units of the data."""
    basis = JointBasis.of(dataset.joint_types, dataset.q)
    per_joint: list[PerJointKernel] = []
    if settings.friction:
        per_joint.append(make_friction(dataset.dq))
    if settings.residual:
        per_joint.append(make_residual(basis, dataset.dq, dataset.ddq))
    return TorqueKernel(_energy_kernel(dataset, settings), basis, tuple(per_joint))


def _energy_kernel(dataset: Dataset, settings: FitSettings) -> EnergyKernel:
    kernel = ENERGY_KERNELS[settings.kernel](dataset.n_joints)
    if dataset.gravity_compensated:
        return without_potential(kernel)
    return POTENTIALS[settings.potential](kernel)


def _check(dataset: Dataset) -> None:
    if dataset.n_samples < LEAST_SAMPLES:
        raise DataError(
            f'a fit needs at least {LEAST_SAMPLES} samples, but the data set has '
            f'{dataset.n_samples}; record longer or keep more samples in preprocessing.'
        )
    still = [
        name
        for name, extent in zip(dataset.joint_names, np.ptp(dataset.tau, axis=0), strict=True)
        if extent == 0.0
    ]
    if still:
        raise DataError(
            f'the torque of joint {still[0]!r} is the same in all {dataset.n_samples} samples, so '
            'nothing can be learned from it; check the effort signal or leave the joint out.'
        )


def _covering(dataset: Dataset, kernel: TorqueKernel, count: int) -> Dataset:
    rows = spread(kernel.basis, dataset.q, dataset.dq, dataset.ddq, count)
    return dataset.select(rows)


def _optimise(
    kernel: TorqueKernel,
    dataset: Dataset,
    settings: FitSettings,
    backend: Backend,
    progress: Progress,
) -> tuple[TorqueKernel, Optimum]:
    def objective(kernel: TorqueKernel, centre: Hyperparameters, some: Dataset) -> Objective:
        states = kernel.states(some.q, some.dq, some.ddq)
        make = LinearLikelihood if kernel.is_linear else backend.likelihood
        likelihood = make(kernel, states, some.tau, centre)
        return Objective(likelihood, centre, settings.prior_precision)

    few = _covering(dataset, kernel, max(LEAST_SAMPLES, settings.subset // 3))
    initialise = INITIALISATIONS.get(settings.kernel, from_torques)
    # Tried on fewer samples, so that all of them together cost less than the optimisation itself.
    tried = [
        _tried(start, objective(start.kernel, start.centre, few), settings, progress, number)
        for number, start in enumerate(initialise(kernel, dataset, settings, progress), start=1)
    ]
    start, trial = min(tried, key=lambda pair: pair[1].value + pair[0].aic_penalty)
    some = _covering(dataset, kernel, settings.subset)
    kernel = with_likely_sign_widths(start.kernel, trial.hyperparameters, some)
    followed = objective(kernel, start.centre, some)
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


def _condition(kernel: TorqueKernel, optimum: Optimum, dataset: Dataset) -> InverseDynamicsModel:
    prior = TorquePrior(kernel, optimum.hyperparameters)
    states = kernel.states(dataset.q, dataset.dq, dataset.ddq)
    return InverseDynamicsModel(
        joint_names=dataset.joint_names,
        process=TorquePosterior.condition(prior, states, dataset.tau),
        potential_reference=dataset.q.mean(axis=0),
        effort_calibrations=effort_calibrations(dataset.provenance, dataset.joint_names),
    )


def _report(optimum: Optimum) -> dict[str, Any]:
    noise: Array = np.sqrt(optimum.hyperparameters.noise_variance)
    return {
        'negative_log_likelihood': optimum.negative_log_likelihood,
        'iterations': optimum.iterations,
        'converged': optimum.converged,
        'optimiser_message': optimum.message,
        'at_bounds': list(optimum.at_bounds),
        'rejected_steps': optimum.rejected,
        'noise_std': noise.tolist(),
    }
