"""Kinetic and potential energy over time."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.evaluation.evaluation import Evaluation
from lip_id_ros.evaluation.outcome import Outcome
from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.report.band import Band


@dataclass(frozen=True)
class _Curve:
    title: str
    estimate: Array
    std: Array
    truth: Array | None
    color: str
    nmse_percent: float | None


def energies(outcome: Outcome, evaluation: Evaluation, band: Band) -> Figure:
    """
    Estimated energies, the true ones where they are known, and the predicted uncertainty.

    The true potential energy is shifted by the mean error, since it is known up to a constant.

    """
    curves = _curves(outcome, evaluation, band)
    figure = style.new_figure(2.7 * len(curves) + style.LEGEND_HEIGHT)
    panels = list(figure.subplots(len(curves), 1, sharex=True, squeeze=False).flat)
    for panel, curve in zip(panels, curves, strict=True):
        _draw(panel, curve, outcome, band)
    style.finish(figure, panels[0])
    return figure


def _curves(outcome: Outcome, evaluation: Evaluation, band: Band) -> list[_Curve]:
    data, estimate = outcome.dataset, outcome.prediction
    curves = [
        _Curve(
            'kinetic energy',
            estimate.kinetic,
            band.kinetic,
            data.kinetic,
            style.KINETIC,
            evaluation.kinetic_nmse_percent,
        )
    ]
    if estimate.potential is not None and band.potential is not None:
        truth = data.potential
        shifted = None if truth is None else truth + np.mean(estimate.potential - truth)
        curves.append(
            _Curve(
                'potential energy',
                estimate.potential,
                band.potential,
                shifted,
                style.POTENTIAL,
                evaluation.potential_nmse_percent,
            )
        )
    return curves


def _draw(panel: Axes, curve: _Curve, outcome: Outcome, band: Band) -> None:
    data = outcome.dataset
    rows = style.shown_rows(data.n_samples)
    time = data.t - data.t[0]
    segment = data.segment[rows]
    if curve.truth is not None:
        true = style.broken_at(segment, curve.truth[rows])
        panel.plot(time[rows], true, color=style.MEASURED, linewidth=3.0, label='true')
    estimate = style.broken_at(segment, curve.estimate[rows])
    panel.plot(time[rows], estimate, color=curve.color, label='estimated')
    width = 2 * band.at(rows, curve.std)
    panel.fill_between(
        time[rows],
        estimate - width,
        estimate + width,
        color=curve.color,
        alpha=0.22,
        linewidth=0,
        label='± 2 standard deviations',
    )
    panel.set_title(curve.title, loc='left')
    style.remark(panel, curve.nmse_percent)
    panel.set_ylabel('energy [J]')
