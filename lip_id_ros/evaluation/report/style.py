"""Style of all plots: colours of quantities, sizes, one panel per joint."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
import math
from typing import Any

import matplotlib
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import printable
from lip_id_ros.joint_types import PRISMATIC, TORQUE_UNITS
from lip_id_ros.model.proof import is_useless

MEASURED = '#9aa5b1'
TRUE = '#1f2933'
PREDICTED = '#2563eb'
RESIDUAL = '#c2410c'
KINETIC = '#0f766e'
POTENTIAL = '#7c3aed'
INERTIAL = '#2563eb'
CORIOLIS = '#d97706'
GRAVITY = '#7c3aed'
FRICTION = '#dc2626'

LINE = 1.3  # width of a curve [points]
LEAST_SHOWN = 1e-6  # percent; on a logarithmic axis every error needs some length

Color = str | tuple[float, ...]

SETTINGS: Any = {
    'font.size': 11,
    'axes.titlesize': 12,
    'axes.titleweight': 'bold',
    'axes.grid': True,
    'axes.axisbelow': True,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.edgecolor': '#7b8794',
    'axes.labelcolor': '#323f4b',
    'axes.xmargin': 0.0,
    'grid.color': '#e4e7eb',
    'xtick.color': '#52606d',
    'ytick.color': '#52606d',
    'legend.frameon': False,
    'legend.fontsize': 11,
    'lines.linewidth': LINE,
    'figure.facecolor': 'white',
    'savefig.dpi': 130,
}

WIDTH = 12.0  # inches
TORQUE = 'torque'
TIME = 'time [s]'
ROW_HEIGHT = 2.1
LEGEND_HEIGHT = 0.45
MOST_POINTS = 3000  # more than a plot has pixels for


def styled() -> AbstractContextManager[None]:
    """Use the settings of this module while plots are made and saved."""
    return matplotlib.rc_context(SETTINGS)


def joint_grid(
    joint_names: Sequence[str],
    joint_types: Sequence[str],
    symbol: str,
    draw: Callable[[Axes, int], None],
    below: str = TIME,
) -> Figure:
    """
    Draw one panel per joint, in two columns, with a common legend.

    `symbol`: quantity of the vertical axes; a torque is a force at prismatic joints. `draw` gets
    the axes and the number of a joint; its labels make the legend. `below`: quantity of the
    horizontal axes; time is common to all.
    """
    n_columns = 1 if len(joint_names) == 1 else 2
    n_rows = math.ceil(len(joint_names) / n_columns)
    figure = new_figure(ROW_HEIGHT * n_rows + LEGEND_HEIGHT)
    panels = grid(figure, len(joint_names), n_columns, sharex=below == TIME)
    for joint, (name, kind) in enumerate(zip(joint_names, joint_types, strict=True)):
        panels[joint].set_title(for_plot(name), loc='left')
        quantity = 'force' if kind == PRISMATIC and symbol == TORQUE else symbol
        panels[joint].set_ylabel(f'{quantity} [{TORQUE_UNITS[kind]}]')
        draw(panels[joint], joint)
    for panel in panels[-n_columns:]:
        panel.tick_params(labelbottom=True)
    finish(figure, panels[:1], below)
    return figure


def grid(figure: Figure, count: int, n_columns: int, sharex: bool = False) -> list[Axes]:
    """Return `count` panels in rows of `n_columns`; the rest of the last row stays empty."""
    n_rows = math.ceil(count / n_columns)
    panels = list(figure.subplots(n_rows, n_columns, sharex=sharex, squeeze=False).flat)
    for panel in panels[count:]:
        panel.set_visible(False)
    return panels[:count]


def new_figure(height: float) -> Figure:
    """Return a figure of full width and a height [inches] that leaves room for the legend."""
    layout = ConstrainedLayoutEngine(
        w_pad=0.1, h_pad=0.06, rect=(0, 0, 1, 1 - LEGEND_HEIGHT / height)
    )
    return Figure(figsize=(WIDTH, height), layout=layout)


def finish(figure: Figure, panels: Sequence[Axes], below: str = TIME) -> None:
    """Put the legend of some panels above all of them, and the horizontal quantity below."""
    figure.supxlabel(below, fontsize=SETTINGS['font.size'], color=SETTINGS['axes.labelcolor'])
    figure.align_ylabels()
    shown = dict[str, Artist]()
    for panel in panels:
        handles, labels = panel.get_legend_handles_labels()
        shown.update(zip(labels, handles, strict=True))
    figure.legend(shown.values(), shown.keys(), loc='upper center', ncol=len(shown))


def remark(panel: Axes, nmse_percent: float | None) -> None:
    """Write an error at the upper right of a panel, where there is one."""
    if nmse_percent is not None and not math.isnan(nmse_percent):
        text = f'nMSE {nmse_percent:.3g} %'
        if is_useless(nmse_percent):
            text = f'hardly better than the mean: {text}'
        panel.set_title(text, loc='right', fontsize=11, fontweight='normal', color='#52606d')


def over_time(
    panel: Axes, data: Dataset, values: Array, color: Color, label: str, width: float = LINE
) -> None:
    """Draw a quantity (N,) of the samples over time, broken where the recording has a gap."""
    rows, t = shown_rows(data.n_samples), times(data)
    if not panel.lines:
        for start in _starts(data)[1:]:
            panel.axvline(t[start], color='#cbd2d9', linestyle=':', linewidth=1.0)
    curve = broken_at(data.segment[rows], values[rows])
    panel.plot(t[rows], curve, color=color, linewidth=width, label=label)


def times(data: Dataset) -> Array:
    """Return the times of the samples from 0 on; recordings follow one another, (N,) [s]."""
    t, end = data.t.copy(), 0.0
    for piece in np.split(t, _starts(data)[1:]):
        piece -= piece[0]
        piece += end
        end = piece.max()
    return t


def _starts(data: Dataset) -> IntArray:
    return np.flatnonzero(np.diff(data.recording, prepend=data.recording[0] - 1))


def shown_rows(n_samples: int) -> IntArray:
    """Return the numbers of evenly spaced samples, at most `MOST_POINTS`."""
    n_shown = min(n_samples, MOST_POINTS)
    return np.linspace(0, n_samples - 1, n_shown).round().astype(np.int64)


def broken_at(segment: IntArray, values: Array) -> Array:
    """Copy a curve with nan at the start of each segment, so that no line crosses a gap."""
    curve = np.array(values, dtype=np.float64)
    curve[1:][np.diff(segment) != 0] = np.nan
    return curve


def for_plot(text: str) -> str:
    """Return text that matplotlib draws as it is: `$` would begin mathematics."""
    return printable(text).replace('$', r'\$')
