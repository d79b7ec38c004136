"""The experiment as a folder: figures, pictures of one trial, and one page with all of them."""

from __future__ import annotations

import os
from pathlib import Path

from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.report.page import page, Picture, picture, write_folder
from lip_id_ros.evaluation.tables import Table
from lip_id_ros.tracking import plots
from lip_id_ros.tracking.experiment import Experiment, LEARNED, Trial
from lip_id_ros.tracking.figures import Figures, learned_energies, notes, tables
from lip_id_ros.tracking.plots import Joints

TITLE = 'Computed torque on a simulated Panda: learned against nominal feedforward'


def write_report(
    folder: str | os.PathLike[str], experiment: Experiment, trial: Trial, of: Figures
) -> Path:
    """
    Write the pictures of a trial and the figures of all.

    Parameters
    ----------
    folder : path
        Made where it does not exist.
    experiment : Experiment
    trial : Trial
        The one to draw.
    of : Figures
        Of this and other trials.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    pictures = [
        each for amplitude in experiment.amplitudes for each in _pictures(trial, amplitude)
    ]
    text = page(TITLE, (), tables(of), notes(of), pictures, _facts(experiment, trial, of))
    return write_folder(folder, text, pictures)


def _pictures(trial: Trial, amplitude: float) -> list[Picture]:
    joints = Joints(trial.model.joint_names, trial.model.joint_types)
    runs = {name: run for (a, name), run in trial.runs.items() if a == amplitude}
    run = runs[LEARNED]
    kinetic, potential = learned_energies(trial.model, run)
    with style.styled():
        drawings = (
            ('positions', 'Positions', 'Reference and measured positions.',
             plots.positions(joints, runs)),
            ('errors', 'Tracking errors', 'Absolute position errors; the scale is logarithmic.',
             plots.errors(joints, runs)),
            ('feedback', 'Feedback', 'Torque of the PD feedback: what the feedforward lacks.',
             plots.feedback(joints, runs)),
            ('energies', 'Energies', 'Along the run with learned feedforward: true and estimated. '
             'The potential energy is known up to a constant.',
             plots.energies(run, kinetic, potential)),
        )  # fmt: skip
        return [
            picture(f'{name}_{amplitude:g}', f'{title}, A = {amplitude:g} rad', caption, figure)
            for name, title, caption, figure in drawings
        ]


def _facts(experiment: Experiment, trial: Trial, of: Figures) -> Table:
    facts = (
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
    return Table('Experiment', (), facts)
