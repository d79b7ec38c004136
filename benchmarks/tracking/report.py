"""Report of the experiment: a page, and plots as in the paper's figure `control_exp`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import os
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

from benchmarks._closed_loop import Tracking
from benchmarks.tracking.experiment import Experiment, LEARNED, NOMINAL, Trial
from benchmarks.tracking.figures import Figures, learned_energies, notes, tables
from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.evaluation.metrics import nmse_percent, nmse_percent_without_offset
from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.report.page import Picture, picture, write_page

COLORS = {LEARNED: style.PREDICTED, NOMINAL: style.RESIDUAL}


@dataclass(frozen=True)
class Joints:
    """Names and types, for titles and units."""

    names: tuple[str, ...]
    types: tuple[str, ...]


def draw_positions(joints: Joints, runs: Mapping[str, Tracking]) -> Figure:
    """Draw reference and positions; the runs are so close to it that they hide each other."""
    reference = runs[LEARNED].reference[0]

    def draw(panel: Axes, joint: int, rows: IntArray) -> None:
        t = runs[LEARNED].t[rows]
        panel.plot(
            t, reference[rows, joint], color=style.MEASURED, linewidth=3.0, label='reference'
        )
        for name, color in COLORS.items():
            panel.plot(t, runs[name].q[rows, joint], color=color, label=name, linewidth=1.0)

    return _grid(joints, runs, 'q', 'rad', draw)


def draw_errors(joints: Joints, runs: Mapping[str, Tracking]) -> Figure:
    """Draw absolute position errors, on a common logarithmic scale."""

    def draw(panel: Axes, joint: int, rows: IntArray) -> None:
        for name, color in reversed(COLORS.items()):
            error = np.abs(runs[name].error[rows, joint])
            panel.plot(runs[name].t[rows], 1e3 * error, color=color, label=name, linewidth=0.8)
        panel.set_yscale('log')
        panel.set_ylim(1e-3, 30.0)

    return _grid(joints, runs, '|error|', 'mrad', draw)


def draw_feedback(joints: Joints, runs: Mapping[str, Tracking]) -> Figure:
    """Draw the torques that the feedback had to add."""

    def draw(panel: Axes, joint: int, rows: IntArray) -> None:
        for name, color in reversed(COLORS.items()):
            values = runs[name].feedback[rows, joint]
            panel.plot(runs[name].t[rows], values, color=color, label=name, linewidth=0.8)

    return _grid(joints, runs, 'feedback', 'N m', draw)


def draw_energies(run: Tracking, kinetic: Array, potential: Array) -> Figure:
    """Draw learned and true energies along a motion, the potential's without its offset."""
    shift = np.mean(potential - run.potential)
    curves = (
        ('kinetic energy', kinetic, run.kinetic, style.KINETIC,
         nmse_percent(kinetic, run.kinetic)),
        ('potential energy', potential, run.potential + shift, style.POTENTIAL,
         nmse_percent_without_offset(potential, run.potential)),
    )  # fmt: skip
    figure = style.new_figure(2 * 2.7 + style.LEGEND_HEIGHT)
    panels = list(figure.subplots(2, 1, sharex=True).flat)
    rows = style.shown_rows(len(run.t))
    for panel, (title, estimate, truth, color, error) in zip(panels, curves, strict=True):
        panel.plot(run.t[rows], truth[rows], color=style.MEASURED, linewidth=3.0, label='true')
        panel.plot(run.t[rows], estimate[rows], color=color, label='predicted')
        panel.set_title(title, loc='left')
        panel.set_ylabel('energy [J]')
        style.remark(panel, float(error))
    style.finish(figure, panels[:1])
    return figure


def _grid(
    joints: Joints,
    runs: Mapping[str, Tracking],
    symbol: str,
    unit: str,
    draw: Callable[[Axes, int, IntArray], None],
) -> Figure:
    rows = style.shown_rows(len(runs[LEARNED].t))

    def panel_of(panel: Axes, joint: int) -> None:
        draw(panel, joint, rows)
        panel.set_ylabel(f'{symbol} [{unit}]')

    return style.joint_grid(joints.names, joints.types, symbol, panel_of)


TITLE = 'Computed torque on a simulated Panda: learned against nominal feedforward'


def write_report(
    folder: str | os.PathLike[str], experiment: Experiment, trial: Trial, of: Figures
) -> Path:
    """
    Write the pictures of one trial and the figures of all into a folder; return the page.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    pictures = [
        each for amplitude in experiment.amplitudes for each in _pictures(trial, amplitude)
    ]
    facts = _facts(experiment, trial, of)
    return write_page(folder, TITLE, facts, (), tables(of), notes(of), pictures)


def _pictures(trial: Trial, amplitude: float) -> list[Picture]:
    joints = Joints(trial.model.joint_names, trial.model.joint_types)
    runs = {name: run for (a, name), run in trial.runs.items() if a == amplitude}
    run = runs[LEARNED]
    kinetic, potential = learned_energies(trial.model, run)
    with style.styled():
        drawings = (
            ('positions', 'Positions', 'Reference and measured positions.',
             draw_positions(joints, runs)),
            ('errors', 'Tracking errors', 'Absolute position errors; the scale is logarithmic.',
             draw_errors(joints, runs)),
            ('feedback', 'Feedback', 'Torque of the PD feedback: what the feedforward lacks.',
             draw_feedback(joints, runs)),
            ('energies', 'Energies', 'Along the run with learned feedforward: true and estimated. '
             'The potential energy is known up to a constant.',
             draw_energies(run, kinetic, potential)),
        )  # fmt: skip
        return [
            picture(f'{name}_{amplitude:g}', f'{title}, A = {amplitude:g} rad', caption, figure)
            for name, title, caption, figure in drawings
        ]


def _facts(experiment: Experiment, trial: Trial, of: Figures) -> tuple[tuple[str, str], ...]:
    return (
        ('reference', f'q_d(t) = posture + A / T t cos(pi t), T = {experiment.horizon:g} s'),
        (
            'nominal model',
            f'masses wrong by up to {100 * experiment.mass_share:g} %, centres of mass by up to '
            f'{100 * experiment.centre_shift:g} cm along each axis; no friction, no rotors',
        ),
        ('nominal models tried', str(len({run.seed for run in of.runs}))),
        ('learned from', f'one run with A = {experiment.amplitude:g} rad under the nominal model'),
        ('model', f'{trial.model.kernel} kernel, {trial.model.n_samples} samples'),
        ('pictures', f'of nominal model {trial.seed}'),
    )
