"""Plots of an arm that is followed through recordings, and the page that shows them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
import os
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
import numpy as np

from lip_id_ros.adaptation.replay import Replay, ReplayedRecording
from lip_id_ros.arrays import Array
from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.report.page import Drawing, drawn, write_page
from lip_id_ros.evaluation.report.style import for_plot
from lip_id_ros.evaluation.tables import Table
from lip_id_ros.joint_types import POSITION_UNITS, TORQUE_UNITS
from lip_id_ros.progress import Progress, silent

ROW_HEIGHT, WINDOW_S, MINUTE = 1.6, 5.0, 60.0
ERRORS = (
    'Root mean square errors of torques in windows of 5 s: of the fit (grey), and of the arm that '
    'is followed, before it learns from a sample (blue). It is the fit until it is trusted.'
)
FRICTION = (
    'Friction of each joint at a usual speed, with two standard deviations; dashed: as fitted.'
)
TIME = 'time in recordings [min]'


def write_report(
    folder: str | os.PathLike[str],
    found: Replay,
    tables: Sequence[Table],
    notes: Sequence[str],
    progress: Progress = silent,
) -> Path:
    """
    Write PNG plots and index.html, which embeds them and needs no network.

    `folder`: created where it does not exist; files of an older report are replaced. Returns the
    page. OSError if the folder cannot be written.

    """
    pictures = drawn(_drawings(found), progress)
    model = found.adaptation.commissioned
    facts = (
        ('joints', ', '.join(model.joint_names)),
        ('recordings', str(len(found.recordings))),
    )
    return write_page(folder, 'An arm that changes', facts, (), tables, notes, pictures)


def _drawings(found: Replay) -> Iterator[Drawing]:
    yield 'errors', 'Errors over time', ERRORS, partial(error_figure, found)
    yield 'friction', 'Friction over time', FRICTION, partial(friction_figure, found)


def error_figure(found: Replay) -> Figure:
    """Draw the errors of each joint over time, of the fit and of the arm that is followed."""
    model = found.adaptation.commissioned
    figure, panels = _panels(found)
    for j, (panel, name) in enumerate(zip(panels, model.joint_names, strict=True)):
        for shift, each in _shifted(found):
            for tau, color in (
                (each.followed.frozen, style.MEASURED),
                (each.followed.served, style.PREDICTED),
            ):
                at, errors = _windows(each, tau[:, j] - each.tau[:, j])
                panel.plot((at - shift) / MINUTE, errors, '.-', color=color)
        panel.set_ylim(bottom=0.0)
        panel.set_title(for_plot(name), loc='left')
        panel.set_ylabel(f'error [{TORQUE_UNITS[model.joint_types[j]]}]')
    return figure


def friction_figure(found: Replay) -> Figure:
    """Draw the friction of each joint at a usual speed over time, with two deviations."""
    model, arm = found.adaptation.commissioned, found.adaptation.arm
    forwards, backwards = arm.friction_at_speed()
    features = 0.5 * (forwards - backwards)
    fitted = features @ arm.start[arm.friction]
    figure, panels = _panels(found)
    for j, panel in enumerate(panels):
        for shift, each in _shifted(found):
            at, torque, std = (each.at - shift) / MINUTE, each.friction[:, j], each.std[:, j]
            panel.plot(at, torque, '.-', color=style.FRICTION)
            low, high = torque - 2.0 * std, torque + 2.0 * std
            panel.fill_between(at, low, high, color=style.FRICTION, alpha=0.2, linewidth=0.0)
        panel.axhline(fitted[j], color=style.TRUE, linewidth=0.9, linestyle='--')
        kind = model.joint_types[j]
        speed = f'{arm.speed[j]:.2g} {POSITION_UNITS[kind]}/s'
        panel.set_title(for_plot(f'{model.joint_names[j]} at {speed}'), loc='left')
        panel.set_ylabel(f'[{TORQUE_UNITS[kind]}]')
    return figure


def _shifted(found: Replay) -> Iterator[tuple[float, ReplayedRecording]]:
    """Return the recordings with the time of all pauses before them [s]."""
    moved = 0.0
    for each in found.recordings:
        yield float(each.t[0]) - moved, each
        moved += float(each.t[-1] - each.t[0])


def _panels(found: Replay) -> tuple[Figure, list[Axes]]:
    """Return a panel for each joint, with lines where recordings end."""
    count = found.adaptation.commissioned.n_joints
    figure = Figure(
        figsize=(style.WIDTH, ROW_HEIGHT * count + 0.6),
        layout=ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.04),
    )
    panels = list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
    ends = [(float(each.t[-1]) - shift) / MINUTE for shift, each in _shifted(found)]
    for panel in panels:
        for end in ends[:-1]:
            panel.axvline(end, color=style.TRUE, linewidth=0.7, linestyle=':')
    panels[-1].set_xlabel(TIME)
    return figure, panels


def _windows(recording: ReplayedRecording, error: Array) -> tuple[Array, Array]:
    """Return the middles of windows, and root mean square errors in them, each of shape (W,)."""
    number = ((recording.t - recording.t[0]) // WINDOW_S).astype(np.int64)
    count = np.bincount(number)
    seen = count > 0
    squares = np.bincount(number, error**2)[seen] / count[seen]
    at = recording.t[0] + WINDOW_S * (np.flatnonzero(seen) + 0.5)
    return at, np.sqrt(squares)
