"""Plans in files: JointTrajectory messages in bags, or in YAML as `ros2 topic echo` has them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
import os
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError, DataError, shortened, SourceError
from lip_id_ros.feedforward.interpolation import Plan
from lip_id_ros.files import path_text, require_regular_file
from lip_id_ros.recording import Bag
from lip_id_ros.recording.bags import is_storage

KIND = 'trajectory_msgs/msg/JointTrajectory'
SUFFIXES = ('.yaml', '.yml')
MOST_BYTES = 2**27
WRAPPERS = ('goal', 'trajectory', 'joint_trajectory')
"""Fields in which goals of actions and messages of MoveIt have a JointTrajectory."""

LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
"""Ten thousand points take a second in C, and minutes in Python."""

FIELDS = ('positions', 'velocities', 'accelerations')


def read_plans(path: str | os.PathLike[str], topic: str = '') -> list[Plan]:
    """
    Return the plans of a file.

    Parameters
    ----------
    path : path-like
        A .yaml file with JointTrajectory messages or goals that hold one, or a bag.
    topic : str
        Of the bag; may be left out where one topic has plans.

    Raises
    ------
    OSError
        If it does not exist, or cannot be opened.
    SourceError, ConfigError
        If it holds no plan, or several topics have plans and none is named.
    DataError
        If points contradict each other.

    """
    path = path_text(path)
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES and os.path.isfile(path) and not is_storage(Path(path)):
        raise SourceError(
            f'{path} must be a plan in .yaml or a bag, but ends in {suffix or "no suffix"}; name '
            'such a file (lip_id excite writes its motions as .yaml or .mcap too).'
        )
    named = _in_yaml(path) if suffix in SUFFIXES else _in_bag(path, topic)
    plans = []
    for place, message in named:
        try:
            plans.append(_plan(message))
        except DataError as error:
            raise DataError(f'{place}: {error}') from error
    if not plans:
        raise SourceError(f'{path} must hold a {KIND}, but has none; name the file of a plan.')
    return plans


def _in_yaml(path: str) -> Iterator[tuple[str, Any]]:
    require_regular_file(path)
    if os.path.getsize(path) > MOST_BYTES:
        raise SourceError(f'{path} must be a plan, but has more than {MOST_BYTES} bytes.')
    try:
        documents = [
            each for each in yaml.load_all(Path(path).read_bytes(), LOADER) if each is not None
        ]
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        reason = ' '.join(str(error).split())
        raise SourceError(f'{path} is not readable YAML ({reason}); correct it there.') from error
    for document in documents:
        yield path, _unwrapped(document)


def _unwrapped(document: Any) -> Any:
    """Return the JointTrajectory that a message holds, or the message itself."""
    while isinstance(document, Mapping) and 'points' not in document:
        inner = [document[name] for name in WRAPPERS if name in document]
        if not inner:
            break
        document = inner[0]
    return document


def _in_bag(path: str, topic: str) -> Iterator[tuple[str, Any]]:
    with Bag(path) as bag:
        names = [each.name for each in bag.topics if each.type == KIND and each.count]
        if topic and topic not in names:
            raise ConfigError(
                f'{path} has no {KIND} on {topic}, but on {", ".join(names) or "none"};'
                ' name one of these.'
            )
        if len(names) > 1 and not topic:
            raise ConfigError(f'{path} has plans on {", ".join(names)}; name one topic of these.')
        for name in [topic] if topic else names:
            for number, (_, message) in enumerate(bag.messages(name), start=1):
                if message is not None:
                    yield f'{path}, message {number} of {name}', message


def _plan(message: Any) -> Plan:
    names = _field(message, 'joint_names')
    points = _field(message, 'points')
    if not isinstance(names, Sequence) or not isinstance(points, Sequence):
        raise DataError(f'joint_names and points must be lists, but {shortened(message)} came.')
    columns = tuple(map(str, names))
    if len(set(columns)) != len(columns):
        raise DataError('joint names must be unique, one comes twice; correct joint_names.')
    states = np.full((len(FIELDS), len(points), len(columns)), np.nan)
    for row, point in enumerate(points):
        for kind, field in enumerate(FIELDS):
            values = _numbers(_field(point, field, ()), field, row)
            if len(values) not in (0, len(columns)):
                raise DataError(
                    f'{field} of point {row} must be {len(columns)} numbers like joint_names, or '
                    f'none, but are {len(values)}; correct the point.'
                )
            if len(values):
                states[kind, row] = values
    return Plan(columns, np.array([_seconds(point) for point in points]), states)


def _seconds(point: Any) -> float:
    after = _field(point, 'time_from_start')
    sec, nanosec = _field(after, 'sec', None), _field(after, 'nanosec', 0)
    if sec is None:  # as ROS 1 called them
        sec, nanosec = _field(after, 'secs', None), _field(after, 'nsecs', 0)
    try:
        return float(sec) + 1e-9 * float(nanosec)
    except (TypeError, ValueError, OverflowError):
        raise DataError(
            f'time_from_start must have sec and nanosec, but is {shortened(after)}; correct it.'
        ) from None


def _numbers(values: Any, field: str, row: int) -> Array:
    try:
        numbers = np.array([float(value) for value in values])
    except (TypeError, ValueError, OverflowError):
        raise DataError(
            f'{field} of point {row} must be numbers, but are {shortened(values)}; correct them.'
        ) from None
    if not np.isfinite(numbers).all():
        raise DataError(f'{field} of point {row} must be finite; correct them.')
    return numbers


_REQUIRED = object()


def _field(message: Any, name: str, default: Any = _REQUIRED) -> Any:
    """Return a field of a message, be it of a bag or of YAML."""
    found = message.get(name, default) if isinstance(message, Mapping) else None
    if not isinstance(message, Mapping):
        found = getattr(message, name, default)
    if found is _REQUIRED:
        raise DataError(
            f'a {KIND} was expected, with {name}, but {shortened(message)} came; name the file of '
            'a plan.'
        )
    return found
