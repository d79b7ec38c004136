"""Plots of an evaluation: torques, residuals, parts of the torque, errors and energies."""

from __future__ import annotations

from dataclasses import dataclass
import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.escaping import for_plot
from lip_id_ros.evaluation.metrics import Evaluation
from lip_id_ros.evaluation.outcome import Outcome, standard_deviation
from lip_id_ros.evaluation.report import style
from lip_id_ros.model import DynamicsModel, Prediction, TorqueModel
from lip_id_ros.progress import Progress, silent

MOST_SAMPLES = 200  # a standard deviation costs far more than a prediction
LEAST_SHOWN = 1e-6  # percent; a bar on a logarithmic axis needs some length

Bar = tuple[str, float, str]


@dataclass(frozen=True)
class Band:
    """
    Predicted standard deviations at some of the samples.

    Attributes
    ----------
    rows : ndarray of int, shape (B,)
        Numbers of the samples, increasing.
    tau : ndarray, shape (B, n)
        Of measured torques: prediction and noise together [N m or N].
    kinetic, potential : ndarray, shape (B,), or None
        Of the energies [J].

    """

    rows: IntArray
    tau: Array
    kinetic: Array
    potential: Array | None

    def at(self, rows: IntArray, std: Array) -> Array:
        """
        Interpolate standard deviations (B,) between the samples at which they are known.

        Parameters
        ----------
        rows : ndarray of int, shape (R,)
            Numbers of samples.
        std : ndarray, shape (B,)
            A column of the band.

        """
        return np.interp(rows, self.rows, std)


def band(model: TorqueModel, outcome: Outcome, progress: Progress = silent) -> Band | None:
    """
    Compute standard deviations at evenly spaced samples; None where the model has none.

    Parameters
    ----------
    model : TorqueModel
        That made the outcome.
    outcome : Outcome
    progress : Progress

    """
    if not isinstance(model, DynamicsModel):
        return None
    n_samples = outcome.dataset.n_samples
    spread = np.linspace(0, n_samples - 1, min(MOST_SAMPLES, n_samples))
    rows = spread.round().astype(np.int64)
    std = standard_deviation(model, outcome.dataset.select(rows), progress)
    return Band(rows, np.hypot(std.tau, model.noise_std), std.kinetic, std.potential)


class _OverTime:
    """Draws quantities of an outcome over time, broken where the recording has a gap."""

    def __init__(self, outcome: Outcome, band: Band | None) -> None:
        data = outcome.dataset
        self._rows = style.shown_rows(data.n_samples)
        self._time = (data.t - data.t[0])[self._rows]
        self._segment = data.segment[self._rows]
        self._band = band

    def line(self, panel: Axes, values: Array, color: str, label: str, width: float) -> None:
        curve = style.broken_at(self._segment, values[self._rows])
        panel.plot(self._time, curve, color=color, linewidth=width, label=label)

    def area(self, panel: Axes, middle: Array, std: Array | None, color: str) -> None:
        """Shade two standard deviations on both sides, where they are known."""
        if self._band is None or std is None:
            return
        curve = style.broken_at(self._segment, middle[self._rows])
        width = 2 * self._band.at(self._rows, std)
        panel.fill_between(
            self._time,
            curve - width,
            curve + width,
            color=color,
            alpha=0.22,
            linewidth=0,
            label='± 2 standard deviations',
        )


def torque(outcome: Outcome, evaluation: Evaluation, band: Band | None) -> Figure:
    """Draw measured and predicted torque per joint, with two standard deviations."""
    data, estimate = outcome.dataset, outcome.prediction.tau
    over_time = _OverTime(outcome, band)

    def draw(panel: Axes, joint: int) -> None:
        predicted = estimate[:, joint]
        over_time.line(panel, data.tau[:, joint], style.MEASURED, 'measured', 2.6)
        over_time.line(panel, predicted, style.PREDICTED, 'predicted', style.LINE)
        over_time.area(panel, predicted, _column(band, joint), style.PREDICTED)
        style.remark(panel, evaluation.nmse_percent[joint])

    return style.joint_grid(data.joint_names, data.joint_types, 'torque', draw)


def residual(outcome: Outcome, band: Band | None) -> Figure:
    """Draw measured minus predicted torque per joint, with two standard deviations."""
    data = outcome.dataset
    residuals = data.tau - outcome.prediction.tau
    zero = np.zeros(data.n_samples)
    over_time = _OverTime(outcome, band)

    def draw(panel: Axes, joint: int) -> None:
        over_time.area(panel, zero, _column(band, joint), style.PREDICTED)
        over_time.line(panel, residuals[:, joint], style.RESIDUAL, 'measured minus predicted', 0.9)

    return style.joint_grid(data.joint_names, data.joint_types, 'residual', draw)


def split(outcome: Outcome, prediction: Prediction) -> Figure:
    """Draw the parts of the predicted torque per joint."""
    data = outcome.dataset
    over_time = _OverTime(outcome, None)
    parts = (
        ('gravity', prediction.gravity, style.GRAVITY),
        ('inertial', prediction.inertial, style.INERTIAL),
        ('Coriolis and centrifugal', prediction.coriolis, style.CORIOLIS),
        ('friction', prediction.friction, style.FRICTION),
    )

    def draw(panel: Axes, joint: int) -> None:
        for label, values, color in parts:
            over_time.line(panel, values[:, joint], color, label, style.LINE)

    return style.joint_grid(data.joint_names, data.joint_types, 'torque', draw)


def energies(outcome: Outcome, evaluation: Evaluation, band: Band | None) -> Figure:
    """
    Draw the predicted energies, with two standard deviations, and the true ones where known.

    The true potential energy is shifted by the mean error, since its constant is free.

    """
    data, estimate = outcome.dataset, outcome.prediction
    shifted = data.potential
    if shifted is not None and estimate.potential is not None:
        shifted = shifted + np.mean(estimate.potential - shifted)
    kinetic_std, potential_std = (band.kinetic, band.potential) if band else (None, None)
    known = [
        _Curve(name, values, std, truth, color)
        for name, values, std, truth, color in (
            ('kinetic', estimate.kinetic, kinetic_std, data.kinetic, style.KINETIC),
            ('potential', estimate.potential, potential_std, shifted, style.POTENTIAL),
        )
        if values is not None
    ]
    figure = style.new_figure(2.7 * len(known) + style.LEGEND_HEIGHT)
    panels = list(figure.subplots(len(known), 1, sharex=True, squeeze=False).flat)
    for panel, curve in zip(panels, known, strict=True):
        curve.draw(panel, _OverTime(outcome, band))
        style.remark(panel, getattr(evaluation, f'{curve.name}_nmse_percent'))
    style.finish(figure, panels[0])
    return figure


@dataclass(frozen=True)
class _Curve:
    name: str
    estimate: Array
    std: Array | None
    truth: Array | None
    color: str

    def draw(self, panel: Axes, over_time: _OverTime) -> None:
        if self.truth is not None:
            over_time.line(panel, self.truth, style.MEASURED, 'true', 3.0)
        over_time.line(panel, self.estimate, self.color, 'predicted', style.LINE)
        over_time.area(panel, self.estimate, self.std, self.color)
        panel.set_title(f'{self.name} energy', loc='left')
        panel.set_ylabel('energy [J]')


def errors(evaluation: Evaluation) -> Figure:
    """Draw the normalised mean squared error of each torque and energy as a bar."""
    bars = _bars(evaluation)
    labels, values, colors = zip(*bars, strict=True)
    shown = np.maximum(np.nan_to_num(values), LEAST_SHOWN)
    figure = Figure(figsize=(style.WIDTH, 0.42 * len(bars) + 1.0), layout='constrained')
    panel = figure.subplots()
    drawn = panel.barh(range(len(bars)), shown, tick_label=labels, color=colors, height=0.62)
    panel.bar_label(drawn, labels=[_label(value) for value in values], padding=5)
    panel.set_xscale('log')
    panel.set_xlim(min(1e-2, shown.min()) / 3, max(1.0, shown.max()) * 4)
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
