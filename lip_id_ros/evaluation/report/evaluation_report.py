"""The page of an evaluation, and the folder of its plots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import os
from pathlib import Path

from matplotlib.figure import Figure

from lip_id_ros.evaluation.cautions import no_better_than_mean
from lip_id_ros.evaluation.metrics import Evaluation, Outcome
from lip_id_ros.evaluation.report import plots
from lip_id_ros.evaluation.report.page import drawn, page, Picture, write_folder
from lip_id_ros.evaluation.report.plots import Band
from lip_id_ros.evaluation.tables import error_table, notes, Table
from lip_id_ros.model import Prediction
from lip_id_ros.progress import Progress, silent

CAPTIONS = {
    'torque': 'Measured torque (grey), predicted torque (blue) and two standard deviations '
    '(of prediction and noise) on both sides.',
    'errors': 'Normalised mean squared error; the axis is logarithmic.',
    'residual': 'Measured minus predicted torque: noise and errors of the model.',
    'energies': 'Predicted energies of the motion; the true ones, where known, in grey. The '
    'constant of the potential energy is free.',
    'torque_split': 'The predicted torque is the sum of these parts.',
}


@dataclass(frozen=True)
class Labels:
    """
    Words of a report.

    Attributes
    ----------
    title : str
    warnings : sequence of str
        Shown above the figures.
    facts : sequence of (str, str)
        Name and value: origin of model and data.

    """

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
    """
    Write PNG plots and index.html, which embeds them and needs no network.

    Parameters
    ----------
    folder : path
        Created where it does not exist; files of an older report are replaced.
    outcome : Outcome
    evaluation : Evaluation
        Its errors.
    band : Band, optional
        Its standard deviations.
    labels : Labels
    progress : Progress
        Called after every picture.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    pictures = _pictures(outcome, evaluation, band, progress)
    text = page(
        labels.title,
        [*labels.warnings, *no_better_than_mean(evaluation.joint_names, evaluation.nmse_percent)],
        [error_table(evaluation)],
        notes(evaluation),
        pictures,
        Table('Model and data', (), labels.facts),
    )
    return write_folder(folder, text, pictures)


def _pictures(
    outcome: Outcome, evaluation: Evaluation, band: Band | None, progress: Progress
) -> list[Picture]:
    predicted = outcome.prediction
    drawings: dict[str, tuple[str, Callable[[], Figure]]] = {
        'torque': (
            'Torque, measured and predicted',
            lambda: plots.torque(outcome, evaluation, band),
        ),
        'errors': ('Errors', lambda: plots.errors(evaluation)),
        'residual': ('Residual', lambda: plots.residual(outcome, band)),
    }
    if predicted.kinetic is not None or predicted.potential is not None:
        drawings['energies'] = 'Energies', lambda: plots.energies(outcome, evaluation, band)
    if isinstance(predicted, Prediction):
        title = 'Parts of the predicted torque'
        drawings['torque_split'] = title, lambda: plots.split(outcome, predicted)
    return drawn(
        [(name, title, CAPTIONS[name], draw) for name, (title, draw) in drawings.items()],
        progress,
    )
