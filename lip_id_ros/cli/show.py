"""Models, data sets and descriptions as tables and lines on a console."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import printable
from lip_id_ros.evaluation.recording_health import finding_lines, health_table
from lip_id_ros.evaluation.tables import (
    error_table,
    notes,
    percent,
    show,
    show_lines,
    Table,
)
from lip_id_ros.joint_types import POSITION_UNITS, TORQUE_UNITS
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

if TYPE_CHECKING:  # recordings are described without models
    from lip_id_ros.evaluation import Evaluation
    from lip_id_ros.model import InverseDynamicsModel

UNSEEN = (
    'Only data that the model has not seen show how good it is: fit with --holdout, or evaluate '
    'it on another recording.'
)
RANGES, HEALTH, KINEMATICS, FRICTION = 'ranges', 'health', 'kinematics', 'friction'
LEFT_OUT = 'left_out_distance'
NOTES, RECORDINGS = 'notes', 'recordings'
NO_RECORDINGS = 'No topic has joint samples: sensor_msgs/JointState, or the state of a controller.'
IN_OTHER_WORDS = (
    *('covariance_inflation', 'denavit_hartenberg', 'descents', 'disturbed'),
    'elected_meeting_axes',
    *('elected_twists_deg', 'friction', 'friction_between_recordings', 'halves_agree'),
    *('inertia_min_eigenvalue', 'inertia_not_pd_percent', 'motion_s', 'new_motion_s', 'noise_std'),
    *('outliers', 'remainder'),
    *('searches_agreed', 'unexplained_left_out', 'unexplained_of_all', 'unexplained_percent'),
    'unpredicted_left_out',
)
"""What of a fit is shown by tables, by its effect, or by a caution; JSON has it as it is."""
SKETCH, COUPLED = 'sketch', 'coupled_positions'
NO_PROCESS = 'for one, fit with fit.terms: named'
INDENT = '  '
MOST_BESIDE = 3
DEFAULTS = {'recording': RecordingSettings(), 'preprocessing': PreprocessingSettings()}


def fitted(model: InverseDynamicsModel, console: Console, origin: str = '') -> None:
    """Show what a fit found; `origin` comes before the number of samples."""
    show(_joint_table(model, origin), console)
    show_lines(motion_lines(model), console)
    if model.arm is not None:
        _show_links(model, console)


def motion_lines(model: InverseDynamicsModel) -> list[str]:
    """Return how much of the motion was new, and how far its left-out parts were from the rest."""
    summary, known = model.summary, model.known_states
    if known is None or 'new_motion_s' not in summary:
        return []
    return [
        f'New motion: {summary["new_motion_s"]:.3g} of {summary["motion_s"]:.3g} s; repetitions '
        f'count once. A novelty of 1 is {known.left_out:.2g} standard deviations from this motion.'
    ]


def _joint_table(model: InverseDynamicsModel, origin: str) -> Table:
    units = [TORQUE_UNITS[kind] for kind in model.joint_types]
    header = ['', 'type', 'noise']
    columns = [model.joint_names, model.joint_types, _with_units(model.noise_std, units)]
    if (shares := model.summary.get('unexplained_percent')) is not None:
        header.append('unexplained [%]')
        columns.append([percent(share) for share in shares])
    if model.arm is not None:
        header.append('friction')
        columns.append([', '.join(names) for names in model.arm.friction.names()])
    title = f'{model.kernel} kernel, {origin}{model.n_samples} samples'
    if (seconds := model.summary.get('seconds_total')) is not None:
        title += f', fitted in {seconds:.3g} s'
    return Table(title, header, list(zip(*columns, strict=True)))


def _with_units(values: Array, units: Sequence[str]) -> list[str]:
    return [f'{value:.3g} {unit}' for value, unit in zip(values, units, strict=True)]


def _show_links(model: InverseDynamicsModel, console: Console) -> None:
    from lip_id_ros.export.arm import residual_gp_of
    from lip_id_ros.export.kinematics import model_kinematics, UNIDENTIFIED
    from lip_id_ros.identification.residual_gp_selection import LEAST_NEW_S

    kinematics = model_kinematics(model)
    assert kinematics is not None, 'the model has links'
    title = f'Denavit-Hartenberg: {kinematics.transform}'
    show(Table(title, ('', *kinematics.header), kinematics.cells()), console)
    text = 'The model has rigid links and friction; a Gaussian process would not improve it.'
    new_s = model.summary.get('new_motion_s', LEAST_NEW_S)
    if new_s < LEAST_NEW_S:
        text = (
            f'The model has rigid links and friction. A Gaussian process needs {LEAST_NEW_S:g} s '
            f'of motion without repetitions, and the recording has {new_s:.3g} s.'
        )
    if (residual_gp := residual_gp_of(model)) is not None:
        text = f'The model has {residual_gp}. A C header cannot hold that; {NO_PROCESS}.'
    show_lines([UNIDENTIFIED] * (not kinematics.identified.all()) + [text], console)


def _residual_gp_joints(model: InverseDynamicsModel) -> list[str]:
    if model.residual_gp is None:
        return []
    pairs = zip(model.joint_names, model.residual_gp.joints, strict=True)
    return [name for name, has in pairs if has]


def described_model(model: InverseDynamicsModel) -> dict[str, Any]:
    """Return the description of a model, as JSON."""
    from lip_id_ros.export.friction_table import friction_table
    from lip_id_ros.export.kinematics import model_kinematics
    from lip_id_ros.rigid_body.couplings import coupling_texts

    links = {}
    if model.arm is not None and (kinematics := model_kinematics(model)) is not None:
        links = {
            'remainder': _residual_gp_joints(model),
            KINEMATICS: kinematics.to_json(),
            COUPLED: coupling_texts(model.arm.chain, model.joint_names),
            FRICTION: [each._asdict() for each in friction_table(model)],
        }
    return {
        'kernel': model.kernel,
        'samples': model.n_samples,
        'joints': list(model.joint_names),
        'joint_types': list(model.joint_types),
        'has_potential_energy': model.has_potential,
        LEFT_OUT: None if model.known_states is None else model.known_states.left_out,
        'provenance': dict(model.provenance),
        **links,
        'fit': dict(model.summary),
    }


def inspected_model(
    model: InverseDynamicsModel, description: Mapping[str, Any], console: Console
) -> None:
    """Show the description of a model, and what its fit found as tables."""
    from lip_id_ros.export.friction_table import Coefficient, HEADER

    fit = {name: value for name, value in description['fit'].items() if name not in IN_OTHER_WORDS}
    hidden = dict.fromkeys((KINEMATICS, FRICTION, LEFT_OUT, 'remainder', COUPLED))
    described({**description, **hidden, 'fit': fit}, console)
    fitted(model, console)
    if rows := [Coefficient(**each).cells() for each in description.get(FRICTION, ())]:
        show(Table('Friction, with standard deviations', HEADER, rows), console)


def evaluated(evaluation: Evaluation, title: str, console: Console) -> None:
    """Show errors and their reference."""
    show(error_table(evaluation, title), console)
    show_lines(notes(evaluation), console)


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


def _span(values: Array) -> str:
    return f'{values.min():.3g} to {values.max():.3g}'


def described(description: Mapping[str, Any], console: Console, indent: str = '') -> None:
    """
    Show a JSON-able, nested description, as `lip_id_ros.preprocessing.describe` returns it.

    What is empty is left out, and so are settings with their defaults and fingerprints.
    """
    for name, value in description.items():
        if name == SKETCH:
            continue
        if name == RANGES:
            show(ranges(value), console)
        elif name == HEALTH:
            _health(value, console)
        elif name == NOTES:
            for note in value:
                _print(f'{indent}note: {note}', console)
        elif name == RECORDINGS and not value:
            _print(NO_RECORDINGS, console)
        elif _is_list_of_mappings(value):
            for number, entry in enumerate(value, start=1):
                _nested(f'{name} {number} of {len(value)}', entry, console, indent)
        elif isinstance(value, Mapping):
            _nested(name, _changed(name, value), console, indent)
        elif not _is_empty(value):
            _print(f'{indent}{name}: {_text(value)}', console)


def _nested(name: str, values: Mapping[str, Any], console: Console, indent: str) -> None:
    there = {key: value for key, value in values.items() if not _is_empty(value)}
    if there and len(there) <= MOST_BESIDE and not any(map(_is_nested, there.values())):
        entries = ', '.join(f'{key} {_text(value)}' for key, value in there.items())
        _print(f'{indent}{name}: {entries}', console)
    elif there:
        _print(f'{indent}{name}:', console)
        described(there, console, indent + INDENT)


def _changed(name: str, values: Mapping[str, Any]) -> Mapping[str, Any]:
    if name not in DEFAULTS:
        return values
    defaults = asdict(DEFAULTS[name])  # tuples, which JSON has as lists
    plain = {key: list(x) if isinstance(x, tuple) else x for key, x in defaults.items()}
    return {key: value for key, value in values.items() if value != plain.get(key)}


def _is_nested(value: Any) -> bool:
    return isinstance(value, Mapping) or _is_list_of_mappings(value)


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str | list | dict) and not value)


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
    torques = 'effort as recorded' if 'effort' in signals else 'tau in N m or N'
    return Table(f'Ranges [rad or m, s], {torques}', ('', *signals), rows)


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
