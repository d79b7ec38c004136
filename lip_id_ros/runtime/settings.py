"""The nodes' own parameters: declaration, types, ranges and descriptions in one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lip_id_ros.config import Config, flat_rows, Row, rows, setting, Settings

EXECUTORS = ('events', 'single_threaded')

_EXECUTOR_HELP = (
    'How callbacks are run; events takes less CPU at high rates and gives way to single_threaded '
    'where this ROS has none.'
)


@dataclass(frozen=True)
class TrainSettings(Settings):
    """The node `train`, beside the settings of a fit."""

    model_path: str = setting('model.npz', 'Where a fit saves the model.')
    dataset_path: str = setting('dataset.npz', 'Where save_dataset saves the data set.')
    unsaved_path: str = setting(
        'unsaved.mcap',
        'Where the samples go that are neither fitted nor saved when the node ends.',
    )
    record_on_start: bool = setting(False, 'Record from the start, without a call of record.')
    max_rows: int = setting(
        1_000_000, 'Most samples kept in memory; later ones are refused and counted.', minimum=1
    )
    fit_niceness: int = setting(
        5, 'How much a fit gives way to other processes of the machine.', minimum=0, maximum=19
    )
    executor: str = setting('events', _EXECUTOR_HELP, choices=EXECUTORS)


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
    autostart: bool = setting(True, 'Configure and activate at the start.')
    publish_commands: bool = setting(
        False, 'Also publish torques on ~/commands, for a forward_command_controller.'
    )
    executor: str = setting('events', _EXECUTOR_HELP, choices=EXECUTORS)


def train_parameters() -> dict[str, Row]:
    """Return all parameters of `train` by name; the topic is chosen by a remap instead."""
    fit = {name: row for name, row in flat_rows(Config()) if name != 'recording.topic'}
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
