"""The nodes' own parameters: declaration, types, ranges and descriptions in one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from lip_id_ros.config import Config, flat_rows, Row, rows, setting, Settings

EXECUTORS = ('events', 'single_threaded')

AT_START = 'at the start only'
AT_ONCE = 'at once'
WHILE_EMPTY = 'at once, while no samples are kept'
NEXT_JOB = 'at the next fit or data set'

_EXECUTOR_HELP = (
    'How callbacks are run; events takes less CPU at high rates and gives way to single_threaded '
    'where this ROS has none.'
)


@dataclass(frozen=True)
class TrainSettings(Settings):
    """The node `train`, beside the settings of a fit."""

    model_path: str = setting('model.npz', 'Where a fit saves the model.', applies=NEXT_JOB)
    dataset_path: str = setting(
        'dataset.npz', 'Where save_dataset saves the data set.', applies=NEXT_JOB
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
    fit_niceness: int = setting(
        5,
        'How much a fit gives way to other processes of the machine.',
        minimum=0,
        maximum=19,
        applies=NEXT_JOB,
    )
    executor: str = setting('events', _EXECUTOR_HELP, choices=EXECUTORS, applies=AT_START)


@dataclass(frozen=True)
class ServeSettings(Settings):
    """The node `serve`."""

    model_path: str = setting('model.npz', 'Model to serve.')
    joints: tuple[str, ...] = setting(
        (), 'Joints that the model must have, in any order; empty to take any model.'
    )
    torque_limits: tuple[float, ...] = setting(
        (),
        'Largest torque or force per joint, in the order of joints, or of the model where joints '
        'is empty; one for all; empty for none.',
        unit='N m or N',
        minimum=0.0,
    )
    output_scale: float = setting(
        1.0, 'Factor on every torque before it is limited.', minimum=0.0, maximum=1.0
    )
    enabled: bool = setting(True, 'Answer from the start, without a call of enable.')
    autostart: bool = setting(True, 'Configure and activate at the start.', applies=AT_START)
    publish_commands: bool = setting(
        False, 'Also publish torques on ~/commands, for a forward_command_controller.'
    )
    executor: str = setting('events', _EXECUTOR_HELP, choices=EXECUTORS)


def train_parameters() -> dict[str, Row]:
    """Return all parameters of `train` by name."""
    times = {'recording.joints': WHILE_EMPTY}
    fit = {
        name: replace(row, applies=times.get(name, NEXT_JOB)) for name, row in flat_rows(Config())
    }
    return {**_own(TrainSettings), **fit}


def serve_parameters() -> dict[str, Row]:
    """Return all parameters of `serve` by name."""
    return _own(ServeSettings)


def _own(table: type[Settings]) -> dict[str, Row]:
    return {row.name: row for row in rows(table)}


def fit_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those parameters of `train` that are settings of a fit."""
    return {name: value for name, value in values.items() if '.' in name}


def own_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those parameters of `train` that are its own."""
    return {name: value for name, value in values.items() if '.' not in name}
