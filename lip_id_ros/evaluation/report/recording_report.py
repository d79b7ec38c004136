"""Plots of a recording, and the page that shows them with the findings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
import math
import os
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import SourceError
from lip_id_ros.evaluation.recording_health import finding_lines, health_table
from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.report.page import Drawing, drawn, write_page
from lip_id_ros.evaluation.report.style import for_plot
from lip_id_ros.health import Evidence
from lip_id_ros.joint_types import POSITION_UNITS, TORQUE_UNITS
from lip_id_ros.progress import Progress, silent

ROW_HEIGHT = 1.5
MOTION_COLUMNS = 4
SIGNALS = (
    'Position, velocity and effort as they were recorded (effort with the scale of the settings).'
)
MOTION = (
    'Position and velocity of each joint, low-passed. A model is reliable near these lines only.'
)


def write_recording_report(
    folder: str | os.PathLike[str],
    source: str,
    recordings: Sequence[tuple[Evidence, Mapping[str, Any]]],
    progress: Progress = silent,
    units: Mapping[str, str] = POSITION_UNITS,
    are_torques: bool = True,
) -> Path:
    """
    Write PNG plots and index.html, which embeds them and needs no network; return the first page.

    Each of several recordings gets a folder 1, 2, ... `units`: of positions, for each joint type.
    `are_torques`: else efforts have no unit. SourceError if there is no recording.
    """
    if not recordings:
        raise SourceError(
            f'--report needs a recording with joint samples, but {source} has none; '
            'leave --report out, or evaluate a model with it.'
        )
    pages = []
    for number, (evidence, health) in enumerate(recordings, start=1):
        target = Path(folder) / str(number) if len(recordings) > 1 else Path(folder)
        pages.append(_report(target, source, evidence, health, units, are_torques))
        progress('plot', number, len(recordings))
    return pages[0]


def _report(
    target: Path,
    source: str,
    evidence: Evidence,
    health: Mapping[str, Any],
    units: Mapping[str, str],
    are_torques: bool,
) -> Path:
    pictures = drawn(_drawings(evidence, units, are_torques), silent)
    findings = health['findings']
    samples = evidence.samples
    facts = (
        ('recording', source),
        ('topic', samples.topic or '-'),
        ('samples', str(samples.n_samples)),
        ('duration', f'{samples.t[-1] - samples.t[0]:.4g} s'),
    )
    return write_page(
        target,
        'Health of a recording',
        facts,
        finding_lines(finding for finding in findings if finding['severity'] != 'note'),
        [health_table(health['joints'])],
        finding_lines(finding for finding in findings if finding['severity'] == 'note'),
        pictures,
    )


def _drawings(
    evidence: Evidence, units: Mapping[str, str], are_torques: bool
) -> Iterator[Drawing]:
    yield 'signals', 'Recorded signals', SIGNALS, partial(signals, evidence, units, are_torques)
    if evidence.motion.segments:
        yield 'motion', 'Velocity over position', MOTION, partial(motion, evidence, units)


def signals(
    evidence: Evidence, units: Mapping[str, str] = POSITION_UNITS, are_torques: bool = True
) -> Figure:
    """Draw position, velocity and effort of each joint over time, as recorded."""
    samples = evidence.samples
    n_joints = samples.n_joints
    figure = Figure(
        figsize=(style.WIDTH, ROW_HEIGHT * n_joints + 0.6),
        layout=ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.04),
    )
    grid = figure.subplots(n_joints, 3, sharex=True, squeeze=False)
    rows = style.shown_rows(samples.n_samples)
    columns = (samples.position, samples.velocity, samples.effort)
    colors = (style.TRUE, style.KINETIC, style.PREDICTED)
    for joint, (name, kind) in enumerate(zip(evidence.names, evidence.joint_types, strict=True)):
        effort = f'tau [{TORQUE_UNITS[kind]}]' if are_torques else 'effort'
        labels = (f'q [{units[kind]}]', f'dq [{_rate(units[kind])}]', effort)
        for panel, values, color, label in zip(grid[joint], columns, colors, labels, strict=True):
            _curve(panel, samples.t[rows], values[rows, joint], color)
            panel.set_ylabel(label)
        grid[joint, 0].set_title(for_plot(name), loc='left')
    for panel in grid[-1]:
        panel.set_xlabel('time [s]')
    figure.align_ylabels()
    return figure


def motion(evidence: Evidence, units: Mapping[str, str] = POSITION_UNITS) -> Figure:
    """Draw velocity over position of each joint."""
    n_joints = len(evidence.names)
    n_columns = min(MOTION_COLUMNS, n_joints)
    figure = Figure(
        figsize=(style.WIDTH, 2.6 * math.ceil(n_joints / n_columns) + 0.2),
        layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08),
    )
    panels = style.grid(figure, n_joints, n_columns)
    for joint, (name, kind) in enumerate(zip(evidence.names, evidence.joint_types, strict=True)):
        panel, unit = panels[joint], units[kind]
        for segment in evidence.motion.segments:
            way = segment.position[:, joint], segment.velocity[:, joint]
            panel.plot(*way, color=style.PREDICTED, linewidth=0.8, alpha=0.6)
        panel.margins(x=0.05)
        panel.set_title(for_plot(name), loc='left')
        panel.set_xlabel(f'position [{unit}]')
        panel.set_ylabel(f'velocity [{_rate(unit)}]')
    return figure


def _rate(unit: str) -> str:
    return ' or '.join(f'{each}/s' for each in unit.split(' or '))


def _curve(panel: Axes, t: Array, values: Array, color: str) -> None:
    if np.isnan(values).any():
        panel.text(0.5, 0.5, 'not recorded', ha='center', va='center', transform=panel.transAxes)
        panel.set_yticks([])
    else:
        panel.plot(t, values, color=color, linewidth=0.9)
