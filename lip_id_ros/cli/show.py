"""Results as tables on a console."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console

from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import Evaluation
from lip_id_ros.evaluation.report import Labels
from lip_id_ros.evaluation.speed import Speed
from lip_id_ros.evaluation.tables import error_table, notes, Table, TORQUE_UNITS
from lip_id_ros.evaluation.terminal import show
from lip_id_ros.model import TrainedModel
from lip_id_ros.rigid_body.axes import angles_between, distances_between

HONEST = (
    'How good the model is shows on data that it has not seen: fit with --holdout, or evaluate it '
    'on another recording.'
)


def fitted(model: TrainedModel, training: Dataset, console: Console) -> None:
    """Show what a fit found."""
    rows = [
        (name, kind, f'{noise:.3g} {TORQUE_UNITS[kind]}', f'{tau.std():.3g} {TORQUE_UNITS[kind]}')
        for name, kind, noise, tau in zip(
            model.joint_names,
            model.joint_types,
            model.noise_std,
            training.tau.T,
            strict=True,
        )
    ]
    seconds = model.summary['seconds_total']
    title = f'{model.kernel} kernel, {model.n_samples} samples, fitted in {seconds:.3g} s'
    show(Table(title, ('', 'type', 'noise', 'std of torque'), rows), console)
    if model.prior.kernel.links:
        _linked(model, console)


def _linked(model: TrainedModel, console: Console) -> None:
    """Show what can be looked up: how each axis lies to the one before it."""
    rows = [
        (name, f'{angle:.1f} deg', '' if distance is None else f'{distance:.3f} m')
        for name, angle, distance in axes(model)
    ]
    if rows:
        header = ('', 'angle', 'distance')
        show(Table('each axis to the one before it, found in the data', header, rows), console)
    if model.prior.kernel.energy.is_empty:
        text = 'Rigid links and friction explain the torques as well as more would.'
    else:
        text = f'The kernel {model.prior.kernel.energy.name!r} explains what rigid links leave.'
    sentences([text], console)


def axes(model: TrainedModel) -> list[tuple[str, float, float | None]]:
    """Return angle [deg] and distance [m] of each axis to the one before it, where it has one."""
    found = []
    for links in model.prior.kernel.links:
        angles, distances = angles_between(links.chain), distances_between(links.chain)
        for name, angle, distance in zip(model.joint_names[1:], angles, distances, strict=True):
            apart = None if np.isnan(distance) else float(distance)
            found.append((name, float(np.degrees(angle)), apart))
    return found


def evaluated(evaluation: Evaluation, title: str, console: Console) -> None:
    """Show errors and what they are measured against."""
    show(error_table(evaluation, title), console)
    sentences(notes(evaluation), console)


def labels(args: argparse.Namespace, model: TrainedModel, warnings: Sequence[str]) -> Labels:
    """Return the words of a report on an evaluation."""
    facts = (
        ('model', args.model),
        ('recordings', ', '.join(args.sources)),
        ('kernel', model.kernel),
        ('samples in the model', str(model.n_samples)),
    )
    return Labels('Inverse dynamics: model against measurement', warnings, facts)


def prepared(dataset: Dataset, console: Console) -> None:
    """Show the size and the ranges of a data set."""
    rows = [
        (name, kind, *(_range(values[:, column]) for values in (dataset.q, dataset.dq)))
        + (_range(dataset.tau[:, column]),)
        for column, (name, kind) in enumerate(
            zip(dataset.joint_names, dataset.joint_types, strict=True)
        )
    ]
    segments = len(set(dataset.segment.tolist()))
    title = f'{dataset.n_samples} samples, uninterrupted segments: {segments}'
    header = ('', 'type', 'q [rad or m]', 'dq [per s]', 'tau [N m or N]')
    show(Table(title, header, rows), console)


def measured(speed: Speed, console: Console) -> None:
    """Show the times of a model."""
    calls = (
        ('torque, kinetic and potential energy', speed.one_query),
        ('the same, and the torque by parts', speed.parts),
        ('standard deviations of torques and energies', speed.deviation),
    )
    rows = [
        (what, f'{times.median:.1f}', f'{times.p99:.1f}', f'{times.max:.1f}')
        for what, times in calls
    ]
    title = f'one sample, {speed.n_joints} joints, model of {speed.n_samples} samples'
    show(Table(title, ('', 'median [us]', '99 of 100 below', 'longest'), rows), console)
    texts = (
        'Torque and energies come out of one evaluation: one of them alone takes as long.',
        f'The first standard deviation takes {speed.factorise_s:.2g} s more.',
        f'Many samples at once, by parts: {speed.batch_per_second:.0f} per second.',
    )
    sentences(texts, console)


def sentences(texts: Sequence[str], console: Console) -> None:
    """Show sentences, one per line."""
    for text in texts:
        console.print(text, markup=False)


def _range(values: Any) -> str:
    return f'{values.min():.3g} to {values.max():.3g}'
