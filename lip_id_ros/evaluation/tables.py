"""Figures as tables of text, the same for terminals and web pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from lip_id_ros.evaluation.evaluation import Evaluation

LEAST_PERCENT = 0.0001
TORQUE_UNITS = {'revolute': 'N m', 'prismatic': 'N'}


@dataclass(frozen=True)
class Table:
    """A table of text: what it shows, the names of its columns, its rows."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


def error_table(evaluation: Evaluation, title: str = 'Errors') -> Table:
    """Return the errors of every joint, their mean and those of the energies."""
    columns = zip(
        evaluation.joint_names,
        evaluation.nmse_percent,
        (TORQUE_UNITS[kind] for kind in evaluation.joint_types),
        evaluation.rmse,
        evaluation.torque_std,
        strict=True,
    )
    rows = [
        (name, percent(nmse), f'{rmse:.3g} {unit}', f'{std:.3g} {unit}')
        for name, nmse, unit, rmse, std in columns
    ]
    rows.append(('mean of the joints', percent(evaluation.nmse_percent_mean), '', ''))
    for name, value in (
        ('kinetic energy', evaluation.kinetic_nmse_percent),
        ('potential energy', evaluation.potential_nmse_percent),
    ):
        if value is not None:
            rows.append((name, percent(value), '', ''))
    return Table(title, ('', 'nMSE [%]', 'RMSE', 'std of torque'), rows)


def notes(evaluation: Evaluation) -> list[str]:
    """Say what the errors are measured against, and whether the inertia matrix makes sense."""
    against = 'true torques of the simulation' if evaluation.against_truth else 'measured torques'
    texts = [
        f'{evaluation.n_samples} samples, compared with the {against}; '
        'nMSE = 100 mean(error^2) / var(torque).'
    ]
    if evaluation.inertia_not_pd_percent is None:
        return texts
    return [
        *texts,
        f'The estimated inertia matrix is not positive definite at '
        f'{evaluation.inertia_not_pd_percent:.3g} % of the samples; its smallest eigenvalue is '
        f'{evaluation.inertia_min_eigenvalue:.3g}.',
    ]


def percent(value: float) -> str:
    """Return a percentage in four decimals or digits, or a dash where there is none."""
    if math.isnan(value):
        return '-'
    if value < LEAST_PERCENT:
        return f'<{LEAST_PERCENT}'
    return f'{value:.4f}' if value < 10 else f'{value:.4g}'
