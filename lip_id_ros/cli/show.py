"""Models, data sets, speeds and descriptions as tables and lines on a console."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.text import Text

from lip_id_ros.arrays import Array
from lip_id_ros.baselines import Baseline
from lip_id_ros.cli.models import Model
from lip_id_ros.dataset import Dataset
from lip_id_ros.escaping import printable
from lip_id_ros.evaluation import Evaluation, no_better_than_mean
from lip_id_ros.evaluation.recording_health import finding_lines, health_table
from lip_id_ros.evaluation.speed import Speed
from lip_id_ros.evaluation.tables import (
    error_table,
    notes,
    show,
    show_lines,
    Table,
)
from lip_id_ros.joint_types import POSITION_UNITS, TORQUE_UNITS
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body.chain import angles_between, distances_between

UNSEEN = (
    'Only data that the model has not seen show how good it is: fit with --holdout, or evaluate '
    'it on another recording.'
)
UNIDENTIFIED = (
    'A distance that is not identified may be anything: other links with the same torques fit as '
    'well. The torques are not affected.'
)
RANGES, HEALTH = 'ranges', 'health'
UNITS = 'rad or m and per second; effort as recorded, tau in N m or N'
INDENT = '  '


def fitted(model: Model, training: Dataset, console: Console) -> None:
    """Show the result of a fit."""
    if isinstance(model, Baseline):
        record = model.record
        text = (
            f'{record.method}: {model.n_joints} joints, {record.n_samples} samples, fitted in '
            f'{record.seconds:.3g} s; the model keeps {model.size} numbers.'
        )
        show_lines([text], console)
        return
    show(_noise_table(model, training), console)
    if model.arm is not None:
        show_links(model, console)


def _noise_table(model: InverseDynamicsModel, training: Dataset) -> Table:
    rows = [
        (name, kind, f'{noise:.3g} {TORQUE_UNITS[kind]}', f'{tau.std():.3g} {TORQUE_UNITS[kind]}')
        for name, kind, noise, tau in zip(
            model.joint_names, model.joint_types, model.noise_std, training.tau.T, strict=True
        )
    ]
    seconds = model.summary['seconds_total']
    title = f'{model.kernel} kernel, {model.n_samples} samples, fitted in {seconds:.3g} s'
    return Table(title, ('', 'type', 'noise', 'std of torque'), rows)


def show_links(model: InverseDynamicsModel, console: Console) -> None:
    """Show the placements that a fit found, and whether anything else explains torques."""
    rows = [(axis.joint, f'{axis.angle_deg:.1f} deg', axis.distance) for axis in axes(model)]
    if rows:
        header = ('', 'angle', 'distance')
        show(Table('each axis to the previous one, found in the data', header, rows), console)
    if any(axis.distance_m is not None and not axis.identified for axis in axes(model)):
        show_lines([UNIDENTIFIED], console)
    joints = _remainder_joints(model)
    if joints:
        text = f'Gaussian processes model the residual of {", ".join(joints)}.'
    else:
        text = 'The model has rigid links and friction; a Gaussian process would not improve it.'
    show_lines([text], console)


class Axis(NamedTuple):
    """
    A joint's axis relative to the previous one.

    The distance is None at prismatic joints, its deviation where the fit did not report one.

    """

    joint: str
    angle_deg: float
    distance_m: float | None
    distance_std_m: float | None

    @property
    def identified(self) -> bool:
        """Whether the distance is known to half of itself, or to 5 cm, at three deviations."""
        if self.distance_m is None or self.distance_std_m is None:
            return self.distance_m is not None
        return 3.0 * self.distance_std_m < max(0.5 * self.distance_m, 0.05)

    @property
    def distance(self) -> str:
        """The distance as text."""
        if self.distance_m is None:
            return ''
        if not self.identified:
            return 'not identified'
        std = '' if self.distance_std_m is None else f' (std {1e3 * self.distance_std_m:.1f} mm)'
        return f'{self.distance_m:.3f} m{std}'


def axes(model: InverseDynamicsModel) -> list[Axis]:
    """Return the axis of each joint but the first, where the model has rigid links."""
    names = model.joint_names[1:]
    if model.arm is None:
        return []
    kinematics = model.summary.get('denavit_hartenberg', {})
    stds = kinematics.get('length_std_m', [None] * model.n_joints)[1:]
    chain = model.arm.chain
    angles = np.degrees(angles_between(chain)).tolist()
    distances = [
        None if np.isnan(distance) else float(distance) for distance in distances_between(chain)
    ]
    return [Axis(*each) for each in zip(names, angles, distances, stds, strict=True)]


def _remainder_joints(model: InverseDynamicsModel) -> list[str]:
    if model.remainder is None:
        return []
    pairs = zip(model.joint_names, model.remainder.joints, strict=True)
    return [name for name, has in pairs if has]


def described_model(model: Model) -> dict[str, Any]:
    """Return the description of a model, as JSON."""
    common = {
        'joints': list(model.joint_names),
        'joint_types': list(model.joint_types),
        'has_potential_energy': model.has_potential,
        'provenance': dict(model.provenance),
    }
    if isinstance(model, Baseline):
        record = model.record
        return {
            'model': record.method,
            'samples': record.n_samples,
            **common,
            'numbers_kept': model.size,
            'fit': {'seconds_total': record.seconds},
        }
    return {
        'kernel': model.kernel,
        'samples': model.n_samples,
        **common,
        **_links(model),
        'fit': dict(model.summary),
    }


def _links(model: InverseDynamicsModel) -> dict[str, Any]:
    if model.arm is None:
        return {}
    found = {
        axis.joint: {
            'angle_deg': axis.angle_deg,
            'distance_m': axis.distance_m and round(axis.distance_m, 7),
            'identified': axis.identified,
        }
        for axis in axes(model)
    }
    return {'remainder': _remainder_joints(model), 'axis_to_the_one_before': found}


def evaluated(evaluation: Evaluation, title: str, console: Console) -> None:
    """Show errors, their reference, and joints that the model does not explain."""
    show(error_table(evaluation, title), console)
    useless = no_better_than_mean(evaluation.joint_names, evaluation.nmse_percent)
    show_lines([*notes(evaluation), *useless], console)


def prepared(dataset: Dataset, console: Console) -> None:
    """Show the size and the ranges of a data set."""
    rows = []
    for joint, (name, kind) in enumerate(
        zip(dataset.joint_names, dataset.joint_types, strict=True)
    ):
        position = POSITION_UNITS[kind]
        units = (position, f'{position}/s', TORQUE_UNITS[kind])
        ranges = [
            f'{_span(values[:, joint])} {unit}'
            for values, unit in zip((dataset.q, dataset.dq, dataset.tau), units, strict=True)
        ]
        rows.append((name, kind, *ranges))
    segments = len(set(dataset.segment.tolist()))
    title = f'{dataset.n_samples} samples, uninterrupted segments: {segments}'
    header = ('', 'type', 'q', 'dq', 'tau')
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
        'Torque and energies are computed together: one of them alone takes as long.',
        f'The first standard deviation takes {speed.factorise_s:.2g} s more.',
        f'Many samples in one call, with parts: {speed.batch_per_second:.0f} per second.',
    )
    show_lines(texts, console)


def _span(values: Array) -> str:
    return f'{values.min():.3g} to {values.max():.3g}'


def described(description: Mapping[str, Any], console: Console, indent: str = '') -> None:
    """Show a JSON-able, nested description, as `lip_id_ros.preprocessing.describe` returns it."""
    for name, value in description.items():
        if name == RANGES:
            show(ranges(value), console)
        elif name == HEALTH:
            _health(value, console)
        elif _is_list_of_mappings(value):
            for number, entry in enumerate(value, start=1):
                _print(f'{indent}{name} {number}:', console)
                described(entry, console, indent + INDENT)
        elif isinstance(value, Mapping) and value:
            _print(f'{indent}{name}:', console)
            described(value, console, indent + INDENT)
        else:
            _print(f'{indent}{name}: {_text(value)}', console)


def _health(health: Mapping[str, Any], console: Console) -> None:
    show(health_table(health['joints']), console)
    show_lines(finding_lines(health['findings']) or ['no findings'], console)


def ranges(by_joint: Mapping[str, Mapping[str, Sequence[float] | None]]) -> Table:
    """Return lowest and highest values per joint and signal as a table."""
    signals = list(next(iter(by_joint.values()), {}))
    rows = [
        (joint, *(_range(values[signal]) for signal in signals))
        for joint, values in by_joint.items()
    ]
    return Table(f'ranges, {UNITS}', ('', *signals), rows)


def _range(values: Sequence[float] | None) -> str:
    return 'absent' if values is None else f'{values[0]:.3g} to {values[1]:.3g}'


def _is_list_of_mappings(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)


def _text(value: Any) -> str:
    if isinstance(value, list):
        return ', '.join(_text(entry) for entry in value) or 'none'
    if value is None or value in ('', {}):
        return 'none'
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    return f'{value:.6g}' if isinstance(value, float) else str(value)


def _print(text: str, console: Console) -> None:
    console.print(Text(printable(text)), soft_wrap=True)
