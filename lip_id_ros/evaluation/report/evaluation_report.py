"""The page of an evaluation: tables, notes and plots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import os
from pathlib import Path

from matplotlib.figure import Figure

from lip_id_ros.evaluation.cautions import evaluation_cautions
from lip_id_ros.evaluation.metrics import Evaluation
from lip_id_ros.evaluation.prediction import Outcome
from lip_id_ros.evaluation.report import figures
from lip_id_ros.evaluation.report.figures import Band
from lip_id_ros.evaluation.report.page import drawn, Picture, write_page
from lip_id_ros.evaluation.tables import error_table, notes
from lip_id_ros.model import Prediction
from lip_id_ros.progress import Progress, silent

CAPTIONS = {
    'torque': 'Measured torque (grey), predicted torque (blue) and two standard deviations '
    '(of prediction and noise) on both sides.',
    'errors': 'Normalised mean squared error; the axis is logarithmic. At the dashed line, 100 %, '
    'a prediction is no better than the mean of the torque.',
    'residual': 'Measured minus predicted torque, and two standard deviations on both sides of '
    'zero.',
    'energies': 'Predicted energies of the motion; the true ones, where known, in grey. The '
    'constant of the potential energy is free.',
    'torque_split': 'The predicted torque is the sum of these parts.',
    'friction': 'Measured torque without that of the links (grey) and predicted friction (red), '
    'over the velocity of each joint. Friction can depend on load, position and acceleration too.',
}


@dataclass(frozen=True)
class Labels:
    """Words of a report: warnings above the figures; name and value of facts."""

    title: str
    warnings: Sequence[str] = ()
    facts: Sequence[tuple[str, str]] = ()


def write_report(
    folder: str | os.PathLike[str],
    outcome: Outcome,
    evaluation: Evaluation,
    band: Band | None,
    labels: Labels,
    progress: Progress = silent,
) -> Path:
    """Write PNG plots and index.html, which embeds them and needs no network; return the page."""
    return write_page(
        folder,
        labels.title,
        labels.facts,
        [*evaluation_cautions(evaluation), *labels.warnings],
        [error_table(evaluation)],
        notes(evaluation),
        _pictures(outcome, evaluation, band, progress),
    )


def _pictures(
    outcome: Outcome, evaluation: Evaluation, band: Band | None, progress: Progress
) -> list[Picture]:
    predicted = outcome.prediction
    drawings: dict[str, tuple[str, Callable[[], Figure]]] = {
        'torque': (
            'Torque, measured and predicted',
            lambda: figures.torque(outcome, evaluation, band),
        ),
        'errors': ('Normalised errors', lambda: figures.errors(evaluation)),
        'residual': ('Residual', lambda: figures.residual(outcome, band)),
    }
    if predicted.kinetic is not None or predicted.potential is not None:
        drawings['energies'] = 'Energies', lambda: figures.energies(outcome, evaluation, band)
    if isinstance(predicted, Prediction):
        title = 'Parts of the predicted torque'
        drawings['torque_split'] = title, lambda: figures.split(outcome, predicted)
        drawings['friction'] = 'Friction', lambda: figures.friction(outcome, predicted)
    return drawn(
        [(name, title, CAPTIONS[name], draw) for name, (title, draw) in drawings.items()],
        progress,
    )
