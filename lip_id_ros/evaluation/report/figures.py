"""The page of an evaluation, and its plots: torques, residuals, parts, energies and errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
import os
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.cautions import evaluation_cautions
from lip_id_ros.evaluation.metrics import Evaluation
from lip_id_ros.evaluation.prediction import Outcome, standard_deviation
from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.report.page import drawn, Picture, write_page
from lip_id_ros.evaluation.report.style import for_plot
from lip_id_ros.evaluation.tables import error_table, notes
from lip_id_ros.joint_types import POSITION_UNITS
from lip_id_ros.model import DynamicsModel, Prediction, TorqueModel
from lip_id_ros.progress import Progress, silent

MOST_SAMPLES = 200  # a standard deviation costs far more than a prediction
MEAN_PERCENT = 100.0  # error of predicting the mean

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

Bar = tuple[str, float, str]


@dataclass(frozen=True)
class Band:
    """
    Predicted standard deviations at some of the samples.

    `rows`, shape (B,): numbers of the samples, increasing. `tau`, shape (B, n): of measured
    torques, with their noise [N m or N]. `kinetic`, `potential`, shape (B,), or None [J].
    """

    rows: IntArray
    tau: Array
    kinetic: Array
    potential: Array | None


def band(model: TorqueModel, outcome: Outcome, progress: Progress = silent) -> Band | None:
    """Compute standard deviations at evenly spaced samples; None where the model has none."""
    if not isinstance(model, DynamicsModel):
        return None
    n_samples = outcome.dataset.n_samples
    spread = np.linspace(0, n_samples - 1, min(MOST_SAMPLES, n_samples))
    rows = spread.round().astype(np.int64)
    std = standard_deviation(model, outcome.dataset, progress, rows)
    return Band(rows, std.measurement, std.kinetic, std.potential)


def _shade(
    panel: Axes, data: Dataset, band: Band | None, middle: Array, std: Array | None, color: str
) -> None:
    """Shade two standard deviations (B,) of a band about a curve (N,), where they are known."""
    if band is None or std is None:
        return
    rows = style.shown_rows(data.n_samples)
    curve = style.broken_at(data.segment[rows], middle[rows])
    width = 2 * np.interp(rows, band.rows, std)
    time = style.times(data)[rows]
    label = '± 2 standard deviations'
    panel.fill_between(
        time, curve - width, curve + width, color=color, alpha=0.22, linewidth=0, label=label
    )


def torque(outcome: Outcome, evaluation: Evaluation, band: Band | None) -> Figure:
    """Draw measured and predicted torque per joint, with two standard deviations."""
    data, estimate = outcome.dataset, outcome.prediction.tau

    def draw(panel: Axes, joint: int) -> None:
        predicted = estimate[:, joint]
        style.over_time(panel, data, data.tau[:, joint], style.MEASURED, 'measured', 2.6)
        style.over_time(panel, data, predicted, style.PREDICTED, 'predicted')
        _shade(panel, data, band, predicted, _column(band, joint), style.PREDICTED)
        style.remark(panel, evaluation.nmse_percent[joint])

    return style.joint_grid(data.joint_names, data.joint_types, style.TORQUE, draw)


def residual(outcome: Outcome, band: Band | None) -> Figure:
    """Draw measured minus predicted torque per joint, with two standard deviations."""
    data = outcome.dataset
    residuals = data.tau - outcome.prediction.tau
    zero = np.zeros(data.n_samples)

    def draw(panel: Axes, joint: int) -> None:
        _shade(panel, data, band, zero, _column(band, joint), style.PREDICTED)
        label = 'measured minus predicted'
        style.over_time(panel, data, residuals[:, joint], style.RESIDUAL, label, 0.9)

    return style.joint_grid(data.joint_names, data.joint_types, 'residual', draw)


def split(outcome: Outcome, prediction: Prediction) -> Figure:
    """Draw the parts of the predicted torque per joint."""
    data = outcome.dataset
    parts = (
        ('gravity', prediction.gravity, style.GRAVITY),
        ('inertial', prediction.inertial, style.INERTIAL),
        ('Coriolis and centrifugal', prediction.coriolis, style.CORIOLIS),
        ('friction', prediction.friction, style.FRICTION),
    )

    def draw(panel: Axes, joint: int) -> None:
        for label, values, color in parts:
            style.over_time(panel, data, values[:, joint], color, label)

    return style.joint_grid(data.joint_names, data.joint_types, style.TORQUE, draw)


def friction(outcome: Outcome, prediction: Prediction) -> Figure:
    """Draw what is no torque of the links against the velocity of each joint."""
    data = outcome.dataset
    rows = style.shown_rows(data.n_samples)
    measured = data.tau - (prediction.tau - prediction.friction)
    parts = (
        ('measured torque minus that of the links', measured, style.MEASURED),
        ('predicted friction', prediction.friction, style.FRICTION),
    )

    def draw(panel: Axes, joint: int) -> None:
        for label, values, color in parts:
            panel.plot(data.dq[rows, joint], values[rows, joint], '.', ms=3, c=color, label=label)

    units = sorted({f'{POSITION_UNITS[kind]}/s' for kind in data.joint_types}, reverse=True)
    velocity = f'velocity [{" or ".join(units)}]'
    return style.joint_grid(data.joint_names, data.joint_types, 'friction', draw, velocity)


def energies(outcome: Outcome, evaluation: Evaluation, band: Band | None) -> Figure:
    """
    Draw the predicted energies, with two standard deviations, and the true ones where known.

    The true potential energy is shifted by the mean error, since its constant is free.
    """
    data, estimate = outcome.dataset, outcome.prediction
    shifted = data.potential
    if shifted is not None and estimate.potential is not None:
        shifted = shifted + np.mean(estimate.potential - shifted)
    known = [
        (name, values, truth, color)
        for name, values, truth, color in (
            ('kinetic', estimate.kinetic, data.kinetic, style.KINETIC),
            ('potential', estimate.potential, shifted, style.POTENTIAL),
        )
        if values is not None
    ]
    figure = style.new_figure(2.7 * len(known) + style.LEGEND_HEIGHT)
    panels = style.grid(figure, len(known), 1, sharex=True)
    for panel, (name, values, truth, color) in zip(panels, known, strict=True):
        if truth is not None:
            style.over_time(panel, data, truth, style.MEASURED, 'true', 3.0)
        style.over_time(panel, data, values, color, f'predicted, {name}')
        _shade(panel, data, band, values, getattr(band, name, None), color)
        panel.set_title(f'{name} energy', loc='left')
        panel.set_ylabel('energy [J]')
        style.remark(panel, getattr(evaluation, f'{name}_nmse_percent'))
    style.finish(figure, panels)
    return figure


def errors(evaluation: Evaluation) -> Figure:
    """Draw the normalised mean squared error of each torque and energy as a bar."""
    bars = _bars(evaluation)
    labels, values, colors = zip(*bars, strict=True)
    shown = np.maximum(np.nan_to_num(values), style.LEAST_SHOWN)
    figure = Figure(figsize=(style.WIDTH, 0.42 * len(bars) + 1.0), layout='constrained')
    panel = figure.subplots()
    drawn = panel.barh(range(len(bars)), shown, tick_label=labels, color=colors, height=0.62)
    panel.bar_label(drawn, labels=[_label(value) for value in values], padding=5)
    panel.set_xscale('log')
    panel.set_xlim(min(1e-2, shown.min()) / 3, max(MEAN_PERCENT, shown.max()) * 4)
    panel.axvline(MEAN_PERCENT, color=style.MEASURED, linestyle='--', zorder=0)
    above = panel.get_xaxis_transform()
    panel.text(MEAN_PERCENT, 1.01, 'as the mean', ha='center', fontsize=10, transform=above)
    panel.invert_yaxis()
    panel.grid(visible=False, axis='y')
    panel.set_xlabel('normalised mean squared error [%]')
    return figure


def _bars(evaluation: Evaluation) -> list[Bar]:
    energies = (
        ('kinetic energy', evaluation.kinetic_nmse_percent, style.KINETIC),
        ('potential energy', evaluation.potential_nmse_percent, style.POTENTIAL),
    )
    joints = zip(evaluation.joint_names, evaluation.nmse_percent, strict=True)
    return [
        *((for_plot(name), value, style.PREDICTED) for name, value in joints),
        *((name, value, color) for name, value, color in energies if value is not None),
    ]


def _label(value: float) -> str:
    return 'constant' if math.isnan(value) else f'{value:.3g} %'


def _column(band: Band | None, joint: int) -> Array | None:
    return None if band is None else band.tau[:, joint]


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
            lambda: torque(outcome, evaluation, band),
        ),
        'errors': ('Normalised errors', lambda: errors(evaluation)),
        'residual': ('Residual', lambda: residual(outcome, band)),
    }
    if predicted.kinetic is not None or predicted.potential is not None:
        drawings['energies'] = 'Energies', lambda: energies(outcome, evaluation, band)
    if isinstance(predicted, Prediction):
        title = 'Parts of the predicted torque'
        drawings['torque_split'] = title, lambda: split(outcome, predicted)
        drawings['friction'] = 'Friction', lambda: friction(outcome, predicted)
    return drawn(
        [(name, title, CAPTIONS[name], draw) for name, (title, draw) in drawings.items()],
        progress,
    )
