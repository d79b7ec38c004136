"""Plots of a designed motion, and the page that shows them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import os
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.report.page import drawn, write_page
from lip_id_ros.evaluation.report.style import for_plot
from lip_id_ros.excitation.motion_tables import (
    learning_tables,
    motion_lines,
    motion_table,
)
from lip_id_ros.excitation.planning import ExcitingMotion
from lip_id_ros.joint_types import POSITION_UNITS, TORQUE_UNITS
from lip_id_ros.progress import Progress, silent

ROW_HEIGHT, RATE_HZ, DEVIATIONS = 1.6, 100.0, 3.0
MOTION = (
    'Positions, velocities, accelerations and, where there is a model, predicted torques with '
    'three standard deviations. Dashed lines are the limits.'
)


def write_motion_report(
    folder: str | os.PathLike[str],
    found: ExcitingMotion,
    progress: Progress = silent,
) -> Path:
    """Write PNG plots and index.html, which embeds them and needs no network; return the page."""
    drawing = 'motion', 'Motion beside its limits', MOTION, partial(motion_figure, found)
    pictures = drawn(iter([drawing]), progress)
    facts = (
        ('joints', ', '.join(found.joint_names)),
        ('duration', f'{found.motion.duration:g} s'),
        ('harmonics', str(found.motion.harmonics)),
    )
    return write_page(
        folder,
        'A motion that teaches',
        facts,
        (),
        [motion_table(found)],
        motion_lines(found),
        pictures,
        learning_tables(found),
    )


def motion_figure(found: ExcitingMotion) -> Figure:
    """Draw q, dq, ddq and predicted torques of each joint over time."""
    n = len(found.joint_names)
    t = np.union1d(found.motion.times(RATE_HZ), found.motion.fine_times)
    states = found.motion.sample(t)
    columns = 3 if found.learning is None else 4
    figure = Figure(
        figsize=(style.WIDTH, ROW_HEIGHT * n + 0.6),
        layout=ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.04),
    )
    panels = figure.subplots(n, columns, sharex=True, squeeze=False)
    limits = found.limits
    ends = (
        (limits.lower, limits.upper),
        (-limits.velocity, limits.velocity),
        (-limits.acceleration, limits.acceleration),
    )
    colors = style.TRUE, style.KINETIC, style.POTENTIAL
    for j, kind in enumerate(found.joint_types):
        unit = POSITION_UNITS[kind]
        labels = f'q [{unit}]', f'dq [{unit}/s]', f'ddq [{unit}/s²]'
        for panel, values, (low, high), color, label in zip(
            panels[j], states, ends, colors, labels, strict=False
        ):
            _curve(panel, t, values[:, j], color, label)
            _limits(panel, (low[j], high[j]))
        panels[j, 0].set_title(for_plot(found.joint_names[j]), loc='left')
    if found.learning is not None:
        _torques(list(panels[:, 3]), found, t, states)
    for panel in panels[-1]:
        panel.set_xlabel(style.TIME)
    figure.align_ylabels()
    return figure


def _torques(
    panels: Sequence[Axes], found: ExcitingMotion, t: Array, states: tuple[Array, Array, Array]
) -> None:
    assert found.learning is not None, 'torques are predicted by a model'
    model = found.learning.before
    tau, std = model.predict(*states, t).tau, model.torque_std(*states, t)
    for j, (panel, kind) in enumerate(zip(panels, found.joint_types, strict=True)):
        _curve(panel, t, tau[:, j], style.PREDICTED, f'tau [{TORQUE_UNITS[kind]}]')
        low, high = (tau[:, j] + sign * DEVIATIONS * std[:, j] for sign in (-1.0, 1.0))
        panel.fill_between(t, low, high, color=style.PREDICTED, alpha=0.2, linewidth=0.0)
        if found.limits.torque is not None:
            _limits(panel, (-found.limits.torque[j], found.limits.torque[j]))


def _curve(panel: Axes, t: Array, values: Array, color: str, label: str) -> None:
    panel.plot(t, values, color=color, linewidth=style.LINE)
    panel.set_ylabel(label)


def _limits(panel: Axes, values: tuple[float, float]) -> None:
    for value in values:
        panel.axhline(value, color=style.RESIDUAL, linewidth=0.9, linestyle='--')
