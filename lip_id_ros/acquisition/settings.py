"""Parameters of the node `train` and of its fits, and checks across them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
import os
from pathlib import Path
from typing import Any

from lip_id_ros import files
from lip_id_ros.checked_file import is_model
from lip_id_ros.dataset import DATASET_SUFFIX
from lip_id_ros.dataset.formats import is_data_set
from lip_id_ros.errors import ConfigError
from lip_id_ros.settings import (
    Config,
    executor_setting,
    flat_rows,
    parameters_of,
    Row,
    setting,
    Settings,
)
from lip_id_ros.settings.settings import AT_ONCE, AT_START, NEXT_JOB, WHILE_EMPTY
from lip_id_ros.signals.joints import require_unique


def _is_payload(path: Path) -> bool:
    from lip_id_ros.export.payload import is_payload  # brings what only a job needs

    return is_payload(path)


OUTPUTS: Mapping[str, tuple[Callable[[Path], bool], str]] = {
    'model_path': (is_model, 'a model'),
    'payload_model_path': (is_model, 'a model'),
    'dataset_path': (is_data_set, 'a data set'),
    'payload_path': (_is_payload, 'a payload'),
}
"""Parameters that name files to write: whether a file is of their kind, and that kind."""

LISTS = ('recording.joint_types', 'recording.effort_scale', 'recording.effort_offset')


@dataclass(frozen=True)
class TrainSettings(Settings):
    """The node `train`, beside the settings of a fit."""

    model_path: str = setting('model.npz', 'Where a fit saves the model.', applies=NEXT_JOB)
    dataset_path: str = setting(
        'dataset.npz', 'Where save_dataset saves the data set.', applies=NEXT_JOB
    )
    use_robot_description: bool = setting(
        False,
        'Take the last URDF of the topic robot_description as fit.description.',
        applies=NEXT_JOB,
    )
    payload_path: str = setting(
        'payload.yaml',
        'Where the service payload saves mass, centre of mass and inertia of the payload at '
        'the arm of model_path.',
        applies=NEXT_JOB,
    )
    payload_model_path: str = setting(
        '',
        'Where the service payload saves the model with the payload; empty: nowhere.',
        applies=NEXT_JOB,
    )
    payload_flange_shift: float = setting(
        0.0,
        "Origin of the flange along the last joint's axis, from the frame of the last link of "
        '`lip_id export`; a payload is given in the frame of the flange.',
        unit='m',
        minimum=-10.0,
        maximum=10.0,
        applies=NEXT_JOB,
    )
    payload_flange_turn: float = setting(
        0.0,
        'Turn of the flange about that axis.',
        unit='degrees',
        minimum=-360.0,
        maximum=360.0,
        applies=NEXT_JOB,
    )
    unsaved_path: str = setting(
        'unsaved.mcap',
        'Where the samples go that no data set was saved of when the node ends; a number is added '
        'to the name where there is such a file.',
        applies=AT_ONCE,
    )
    bags: tuple[str, ...] = setting(
        (),
        'Recordings (rosbag2 folders, .mcap, .db3, ROS 1 .bag) and data sets (.npz) that every '
        'fit and data set uses beside what the node records itself.',
        applies=NEXT_JOB,
    )
    holdout: float = setting(
        0.0,
        'Share of the samples, the last ones, that is kept out of a fit; the errors on them are '
        'in the status.',
        minimum=0.0,
        maximum=0.9,
        applies=NEXT_JOB,
    )
    record_on_start: bool = setting(
        False, 'Record from the start, without a call of record.', applies=AT_START
    )
    max_rows: int = setting(
        1_000_000,
        'Most samples kept in memory, about 25 bytes for each joint of each and twice that while '
        'a fit begins; later ones are rejected and counted.',
        minimum=1,
        applies=WHILE_EMPTY,
    )
    executor: str = executor_setting()


def train_parameters() -> dict[str, Row]:
    """Return all parameters of `train` by name."""
    times = {'recording.joints': WHILE_EMPTY}
    fit = {
        name: replace(row, applies=times.get(name, NEXT_JOB)) for name, row in flat_rows(Config())
    }
    return {**parameters_of(TrainSettings), **fit}


def fit_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those parameters of `train` that are settings of a fit."""
    return {name: value for name, value in values.items() if '.' in name}


def own_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those parameters of `train` that are its own."""
    return {name: value for name, value in values.items() if '.' not in name}


def check_together(values: Mapping[str, Any]) -> None:
    """Raise ConfigError where parameters of `train` contradict each other, or a bag is absent."""
    joints = values['recording.joints']
    require_unique('recording.joints', joints)
    for name in LISTS:
        count = len(values[name])
        if joints and count not in (0, len(joints)):
            raise ConfigError(
                f'{name} must have one value for each of the {len(joints)} recording.joints, not '
                f'{count}; complete it, or leave it empty.'
            )
    for path in values['bags']:
        if not os.path.exists(path):  # Path.exists raises an error where a name is too long
            raise ConfigError(
                f'bags must be recordings or data sets, but {path or "an empty path"} does not '
                'exist; correct the '
                'path, which is relative to the folder in which the node was started.'
            )
    places = {os.path.realpath(path): 'one of the bags' for path in values['bags']}
    for name in OUTPUTS:
        place = os.path.realpath(values[name])
        if values[name] and place in places:
            raise ConfigError(
                f'{name} must name a file of its own, but {values[name]} is {places[place]}; '
                'change one of them.'
            )
        places[place] = name


def require_writable(name: str, path: str) -> None:
    """Raise ConfigError for a path at which no file can be written, or another one lies."""
    if not path:
        raise ConfigError(f'{name} must name a file, but is empty.')
    try:
        files.require_writable(path)
        is_own, kind = OUTPUTS.get(name, (lambda _: True, ''))
        target = Path(path)
        if target.exists() and target.stat().st_size and not is_own(target):
            raise ConfigError(f'{target} exists and is not {kind}; name another file.')
        if name == 'dataset_path':
            files.require_suffix(path, DATASET_SUFFIX, 'the data set')
    except ConfigError as error:
        raise ConfigError(f'{name}: {error}') from error
