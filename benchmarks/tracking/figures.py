"""The experiment's figures, in the paper's form (table `control_exp`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks._closed_loop import Tracking
from benchmarks.tracking.experiment import INFORMED, LEARNED, NOMINAL, Trial
from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError
from lip_id_ros.evaluation.metrics import nmse_percent, nmse_percent_without_offset
from lip_id_ros.evaluation.tables import Table
from lip_id_ros.model import InverseDynamicsModel

POSITION, FEEDBACK = 'position_nmse_percent', 'feedback_mean_square'
TITLES = {
    POSITION: 'Joint position nMSE [%]',
    FEEDBACK: 'Mean square of the feedback [(N m)^2]',
}


@dataclass(frozen=True)
class RunFigures:
    """
    How well one run of an amplitude [rad] followed its reference, per joint.

    `position_nmse_percent` is 100 mean((q - q_d)^2) / var(q_d), q as measured;
    `feedback_mean_square` is in (N m)^2.

    """

    seed: int
    amplitude: float
    feedforward: str
    position_nmse_percent: tuple[float, ...]
    feedback_mean_square: tuple[float, ...]


@dataclass(frozen=True)
class Figures:
    """
    All runs of all trials, and what the learned feedforward gains over the nominal one.

    Errors of the learned energies along the learned runs are keyed by seed and amplitude; the
    potential energy's are without its mean error.

    """

    joint_names: tuple[str, ...]
    runs: tuple[RunFigures, ...]
    kinetic_nmse_percent: dict[tuple[int, float], float]
    potential_nmse_percent: dict[tuple[int, float], float]

    def gains(self, name: str, over: str) -> Array:
        """
        Ratios of another feedforward's `POSITION` or `FEEDBACK` figure to the learned one's.

        Above 1 the learned one is better; shape (seeds * amplitudes, n).

        """
        learned, other = (
            np.array([getattr(run, name) for run in self.runs if run.feedforward == feedforward])
            for feedforward in (LEARNED, over)
        )
        return np.asarray(other / learned)

    def to_json(self) -> dict[str, Any]:
        """Return figures and gains by name."""
        return {
            'joint_names': list(self.joint_names),
            'runs': [vars(run) | self._energies(run) for run in self.runs],
            'least_position_gain': least(self, POSITION, NOMINAL),
            'least_feedback_gain': least(self, FEEDBACK, NOMINAL),
        }

    def _energies(self, run: RunFigures) -> dict[str, float | None]:
        key = (run.seed, run.amplitude)
        if run.feedforward != LEARNED:
            return {'kinetic_nmse_percent': None, 'potential_nmse_percent': None}
        return {
            'kinetic_nmse_percent': self.kinetic_nmse_percent[key],
            'potential_nmse_percent': self.potential_nmse_percent[key],
        }


def figures(trials: Sequence[Trial]) -> Figures:
    """Compute the figures of some trials."""
    energies = {
        (trial.seed, amplitude): _energy_errors(trial.model, run)
        for trial in trials
        for (amplitude, feedforward), run in trial.runs.items()
        if feedforward == LEARNED
    }
    return Figures(
        trials[0].model.joint_names,
        tuple(
            _of_run(trial.seed, *key, run) for trial in trials for key, run in trial.runs.items()
        ),
        {key: kinetic for key, (kinetic, _) in energies.items()},
        {key: potential for key, (_, potential) in energies.items()},
    )


def tables(of: Figures) -> list[Table]:
    """Return the paper's rows per amplitude and figure, medians where there are several seeds."""
    amplitudes = dict.fromkeys(run.amplitude for run in of.runs)
    return [
        _table(of, amplitude, title, name)
        for amplitude in amplitudes
        for name, title in TITLES.items()
    ]


def notes(of: Figures) -> list[str]:
    """Say what the learned feedforward gains, at the joint and seed where it gains least."""
    return [
        'Position: 100 mean((q - q_d)^2) / var(q_d). Medians where there are several nominal '
        'models.',
        *(_comparison(of, other) for other in (NOMINAL, INFORMED)),
    ]


def _comparison(of: Figures, other: str) -> str:
    position, feedback = (np.round(of.gains(name, other), 2) for name in (POSITION, FEEDBACK))
    return (
        f'{other} / learned, over all joints, amplitudes and nominal models: position nMSE '
        f'{_range(position)}, mean-square feedback {_range(feedback)}.'
    )


def _range(ratios: Array) -> str:
    return f'{ratios.min():.3g} to {ratios.max():.3g} (median {np.median(ratios):.3g})'


def least(of: Figures, name: str, over: str) -> float:
    """Return the smallest of `Figures.gains`."""
    return float(of.gains(name, over).min())


def learned_energies(model: InverseDynamicsModel, run: Tracking) -> tuple[Array, Array]:
    """Return both energies (N,) [J] along a run; ModelError where a model has only T."""
    estimate = model.predict(run.q, run.dq, np.zeros_like(run.q))
    if estimate.potential is None:
        raise ModelError(
            'the model must have a potential energy, but has none; learn gravity too.'
        )
    return estimate.kinetic, estimate.potential


def _of_run(seed: int, amplitude: float, feedforward: str, run: Tracking) -> RunFigures:
    return RunFigures(
        seed,
        amplitude,
        feedforward,
        tuple(nmse_percent(run.q, run.reference[0]).tolist()),
        tuple(np.mean(np.square(run.feedback), axis=0).tolist()),
    )


def _energy_errors(model: InverseDynamicsModel, run: Tracking) -> tuple[float, float]:
    kinetic, potential = learned_energies(model, run)
    return (
        float(nmse_percent(kinetic, run.kinetic)),
        float(nmse_percent_without_offset(potential, run.potential)),
    )


def _table(of: Figures, amplitude: float, title: str, name: str) -> Table:
    some = [run for run in of.runs if run.amplitude == amplitude]
    medians = {
        feedforward: np.median(
            [getattr(run, name) for run in some if run.feedforward == feedforward], axis=0
        )
        for feedforward in dict.fromkeys(run.feedforward for run in some)
    }
    rows = [
        (feedforward, *(f'{value:.1e}' for value in values))
        for feedforward, values in medians.items()
    ]
    joints = [f'J{number}' for number in range(1, len(of.joint_names) + 1)]
    return Table(f'{title}, A = {amplitude:g} rad', ('', *joints), rows)
