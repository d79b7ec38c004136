"""A folder with the plots of an evaluation and one page that holds them all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import os
from pathlib import Path

from matplotlib.figure import Figure

from lip_id_ros.evaluation.evaluation import Evaluation
from lip_id_ros.evaluation.outcome import Outcome
from lip_id_ros.evaluation.report import energy_plots, error_plot, torque_plots
from lip_id_ros.evaluation.report.band import Band
from lip_id_ros.evaluation.report.folder import drawn, write_folder
from lip_id_ros.evaluation.report.page import page, Picture
from lip_id_ros.evaluation.tables import error_table, notes, Table
from lip_id_ros.progress import Progress, silent

CAPTIONS = {
    'torque': 'Measured torque (grey), predicted torque (blue) and two standard deviations '
    '(of prediction and noise) on both sides.',
    'errors': 'Normalized mean squared error; the axis is logarithmic.',
    'residual': 'Measured minus predicted torque: noise, and what the model does not explain.',
    'energies': 'Energies of the motion as the model estimates them; where the true ones are '
    'known, they are drawn in grey. The potential energy is known up to a constant.',
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
        What a reader must know before believing the figures.
    facts : sequence of (str, str)
        Name and value: where model and data come from.

    """

    title: str
    warnings: Sequence[str] = ()
    facts: Sequence[tuple[str, str]] = ()


def write_report(
    folder: str | os.PathLike[str],
    outcome: Outcome,
    evaluation: Evaluation,
    uncertainty: Band,
    labels: Labels,
    progress: Progress = silent,
) -> Path:
    """
    Write PNG plots and index.html, which embeds them and needs no network.

    Parameters
    ----------
    folder : path
        Made where it does not exist; files of an older report are replaced.
    outcome : Outcome
    evaluation : Evaluation
        Its errors.
    uncertainty : Band
        Its standard deviations.
    labels : Labels
    progress : Progress
        Told after every picture.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    pictures = _pictures(outcome, evaluation, uncertainty, progress)
    text = page(
        labels.title,
        labels.warnings,
        [error_table(evaluation)],
        notes(evaluation),
        pictures,
        Table('Model and data', (), labels.facts),
    )
    return write_folder(folder, text, pictures)


def _pictures(
    outcome: Outcome, evaluation: Evaluation, band: Band, progress: Progress
) -> list[Picture]:
    drawings: tuple[tuple[str, str, Callable[[], Figure]], ...] = (
        (
            'torque',
            'Torque, measured and predicted',
            lambda: torque_plots.torque(outcome, evaluation, band),
        ),
        ('errors', 'Errors', lambda: error_plot.errors(evaluation)),
        ('residual', 'What is left over', lambda: torque_plots.residual(outcome, band)),
        ('energies', 'Energies', lambda: energy_plots.energies(outcome, evaluation, band)),
        ('torque_split', 'Parts of the predicted torque', lambda: torque_plots.split(outcome)),
    )
    return drawn([(name, title, CAPTIONS[name], draw) for name, title, draw in drawings], progress)
