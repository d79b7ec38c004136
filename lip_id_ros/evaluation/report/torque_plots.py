"""Torques over time: measured against predicted, what is left over, and their parts."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lip_id_ros.evaluation.evaluation import Evaluation
from lip_id_ros.evaluation.outcome import Outcome
from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.report.band import Band


def torque(outcome: Outcome, evaluation: Evaluation, band: Band) -> Figure:
    """Measured and predicted torque per joint, with the predicted uncertainty."""
    data = outcome.dataset
    rows = style.shown_rows(data.n_samples)
    time = data.t - data.t[0]
    estimate = outcome.prediction.tau

    def draw(panel: Axes, joint: int) -> None:
        width = 2 * band.at(rows, band.tau[:, joint])
        measured = style.broken_at(data.segment[rows], data.tau[rows, joint])
        predicted = style.broken_at(data.segment[rows], estimate[rows, joint])
        panel.plot(time[rows], measured, color=style.MEASURED, linewidth=2.6, label='measured')
        panel.plot(time[rows], predicted, color=style.PREDICTED, label='predicted')
        panel.fill_between(
            time[rows],
            predicted - width,
            predicted + width,
            color=style.PREDICTED,
            alpha=0.22,
            linewidth=0,
            label='± 2 standard deviations',
        )
        style.remark(panel, evaluation.nmse_percent[joint])

    return style.joint_grid(data.joint_names, data.joint_types, 'torque', draw)


def residual(outcome: Outcome, band: Band) -> Figure:
    """Measured minus predicted torque per joint, with the predicted uncertainty."""
    data = outcome.dataset
    rows = style.shown_rows(data.n_samples)
    time = data.t - data.t[0]
    left_over = outcome.dataset.tau - outcome.prediction.tau

    def draw(panel: Axes, joint: int) -> None:
        curve = style.broken_at(data.segment[rows], left_over[rows, joint])
        width = 2 * band.at(rows, band.tau[:, joint])
        panel.fill_between(
            time[rows],
            -width,
            width,
            color=style.PREDICTED,
            alpha=0.22,
            linewidth=0,
            label='± 2 standard deviations',
        )
        panel.plot(
            time[rows],
            curve,
            color=style.RESIDUAL,
            linewidth=0.9,
            label='measured minus predicted',
        )

    return style.joint_grid(data.joint_names, data.joint_types, 'residual', draw)


def split(outcome: Outcome) -> Figure:
    """Parts of the predicted torque per joint."""
    data, estimate = outcome.dataset, outcome.prediction
    rows = style.shown_rows(data.n_samples)
    time = data.t - data.t[0]
    parts = (
        ('gravity', estimate.gravity, style.GRAVITY),
        ('inertial', estimate.inertial, style.INERTIAL),
        ('Coriolis and centrifugal', estimate.coriolis, style.CORIOLIS),
        ('friction', estimate.friction, style.FRICTION),
    )

    def draw(panel: Axes, joint: int) -> None:
        for label, values, color in parts:
            curve = style.broken_at(data.segment[rows], values[rows, joint])
            panel.plot(time[rows], curve, color=color, label=label)

    return style.joint_grid(data.joint_names, data.joint_types, 'torque', draw)
