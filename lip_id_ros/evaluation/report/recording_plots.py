"""Plots of a recording as it came: what was recorded, and where the joints have been."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.tables import TORQUE_UNITS
from lip_id_ros.health import Evidence

POSITION_UNITS = {'revolute': 'rad', 'prismatic': 'm'}
ROW_HEIGHT = 1.5
COLUMN_TITLES = ('position', 'velocity', 'effort')
COVERAGE_COLUMNS = 4


def signals(evidence: Evidence) -> Figure:
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
        unit = POSITION_UNITS[kind]
        units = (unit, f'{unit}/s', TORQUE_UNITS[kind])
        for panel, values, color, label in zip(grid[joint], columns, colors, units, strict=True):
            _curve(panel, samples.t[rows], values[rows, joint], color)
            panel.set_ylabel(f'[{label}]')
        grid[joint, 0].set_title(name, loc='left')
    for panel, title in zip(grid[0], COLUMN_TITLES, strict=True):
        panel.set_title(title, loc='right', fontweight='normal')
    for panel in grid[-1]:
        panel.set_xlabel('time [s]')
    figure.align_ylabels()
    return figure


def coverage(evidence: Evidence) -> Figure:
    """Draw where each joint has been in position and velocity."""
    n_joints = len(evidence.names)
    n_columns = min(COVERAGE_COLUMNS, n_joints)
    n_rows = -(-n_joints // n_columns)
    figure = Figure(
        figsize=(style.WIDTH, 2.6 * n_rows + 0.2),
        layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08),
    )
    panels = list(figure.subplots(n_rows, n_columns, squeeze=False).flat)
    for joint, (name, kind) in enumerate(zip(evidence.names, evidence.joint_types, strict=True)):
        panel, unit = panels[joint], POSITION_UNITS[kind]
        for stretch in evidence.motion.stretches:
            way = stretch.position[:, joint], stretch.velocity[:, joint]
            panel.plot(*way, color=style.PREDICTED, linewidth=0.8, alpha=0.6)
        panel.margins(x=0.05)
        panel.set_title(name, loc='left')
        panel.set_xlabel(f'position [{unit}]')
        panel.set_ylabel(f'velocity [{unit}/s]')
    for panel in panels[n_joints:]:
        panel.set_visible(False)
    return figure


def _curve(panel: Axes, t: Array, values: Array, color: str) -> None:
    if np.isnan(values).any():
        panel.text(0.5, 0.5, 'not recorded', ha='center', va='center', transform=panel.transAxes)
        panel.set_yticks([])
    else:
        panel.plot(t, values, color=color, linewidth=0.9)
