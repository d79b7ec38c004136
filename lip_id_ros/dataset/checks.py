"""Checks of a data set; each raises an error with a sentence of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.errors import DataError, ShapeError, shortened
from lip_id_ros.joint_types import JOINT_TYPES

PER_JOINT = ('q', 'dq', 'ddq', 'tau', 'tau_noiseless', 'low_passed_sign', 'dahl_states')
PER_SAMPLE = ('t', 'kinetic', 'potential')
INDICES = ('segment', 'recording')
DERIVED = ('dahl_states',)
"""Not kept in files: it follows from the rest, and has one more dimension."""

LARGEST_INDEX = 2**53  # beyond it, floats are not all the whole numbers

Arrays = Mapping[str, NDArray[Any]]


def checked(fields: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return read-only copies of the arrays of a data set, and tuples of names and types.

    The errors are those of `Dataset`.
    """
    given = {name: fields[name] for name in (*PER_SAMPLE, *PER_JOINT)}
    arrays: dict[str, Any] = {
        name: floats(name, value) for name, value in given.items() if value is not None
    }
    recording = fields['recording']
    if np.size(recording) == 0:
        recording = np.zeros(arrays['q'].shape[:1], np.int64)
    if not isinstance(fields['provenance'], Mapping):
        kind = type(fields['provenance']).__name__
        raise DataError(f'provenance must be a mapping by name, not {kind}.')
    if not isinstance(fields['gravity_compensated'], bool | np.bool_):
        value = shortened(fields['gravity_compensated'])
        raise DataError(f'gravity_compensated must be True or False, not {value}.')
    arrays['segment'] = integers('segment', fields['segment'])
    arrays['recording'] = integers('recording', recording)
    names, types = (texts(each, fields[each]) for each in ('joint_names', 'joint_types'))
    check_shapes(arrays, joint_names=names, joint_types=types)
    check_joints(names, types)
    check_finite(arrays, names)
    check_time(arrays['t'], arrays['segment'], arrays['recording'])
    return {**arrays, 'joint_names': names, 'joint_types': types}


def texts(name: str, values: Any) -> tuple[str, ...]:
    """Return texts, one per joint; DataError where there is no list."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise DataError(f'{name} must be a list with one text per joint, not {shortened(values)}.')
    return tuple(map(str, values))


def floats(name: str, value: Any) -> Array:
    """Return a read-only float64 copy; DataError where there are other things than numbers."""
    with np.errstate(over='ignore'):  # longer floats become infinite, which is refused
        array = _numbers(name, value).astype(np.float64)
    array.setflags(write=False)
    return array


def integers(name: str, value: Any) -> IntArray:
    """Return a read-only int64 copy; DataError where there are other things than whole numbers."""
    numbers = _numbers(name, value)
    if (np.abs(numbers) > LARGEST_INDEX).any() or (numbers != np.round(numbers)).any():
        raise DataError(f'{name} must hold whole numbers; number {name}s 0, 1, 2 and so on.')
    array = numbers.astype(np.int64)
    array.setflags(write=False)
    return array


def _numbers(name: str, value: Any) -> NDArray[Any]:
    try:
        array = np.array(value)
    except ValueError as error:
        raise ShapeError(f'{name} must have rows of equal length ({error}).') from error
    except Exception as error:  # whatever the array of another library raises
        raise DataError(f'{name} must become an array of numpy, but cannot ({error}).') from error
    if np.ma.is_masked(value):
        raise DataError(f'{name} must have every value, but some are masked; select the others.')
    if array.dtype.kind not in 'iuf':
        raise DataError(f'{name} must hold numbers, not {array.dtype}; convert it first.')
    return array


def check_shapes(arrays: Arrays, **per_joint: tuple[str, ...]) -> None:
    """Raise ShapeError unless every array and tuple agrees with the shape of q."""
    shape = arrays['q'].shape
    if len(shape) != 2 or 0 in shape:
        raise ShapeError(
            f'q must have shape (samples, joints) with at least one of each, not {shape}.'
        )
    for name, value in arrays.items():
        expected = shape if name in PER_JOINT else shape[:1]
        if value.shape[: 2 if name in DERIVED else None] != expected:
            raise ShapeError(f'{name} must have shape {expected} like q, not {value.shape}.')
    for name, values in per_joint.items():
        if len(values) != shape[1]:
            raise ShapeError(f'{name} must name the {shape[1]} joints of q, not {len(values)}.')


def check_joints(names: tuple[str, ...], types: tuple[str, ...]) -> None:
    """Raise DataError unless names are unique and types known."""
    for name, count in Counter(names).items():
        if not name:
            raise DataError('every joint needs a name, but one of joint_names is empty.')
        if count > 1:
            raise DataError(f'joint_names must be unique, but {name!r} comes twice.')
    for kind in types:
        if kind not in JOINT_TYPES:
            raise DataError(f'a joint type must be revolute or prismatic, not {kind!r}.')


def check_finite(arrays: Arrays, joint_names: tuple[str, ...]) -> None:
    """Raise DataError at the first number that is not finite."""
    for name, value in arrays.items():
        if np.isfinite(value).all():
            continue
        at = tuple(int(index) for index in np.argwhere(~np.isfinite(value))[0])
        joint = f' of {joint_names[at[1]]}' if len(at) == 2 else ''
        raise DataError(
            f'{name} must be finite, but sample {at[0]}{joint} is {value[at]}; '
            'remove such samples.'
        )


def check_time(t: Array, segment: IntArray, recording: IntArray) -> None:
    """Raise DataError where a segment is torn apart or time goes back within it."""
    begins = np.flatnonzero(np.diff(segment)) + 1
    runs = segment[np.concatenate([[0], begins])]
    if np.unique(runs).size != runs.size:
        numbers, counts = np.unique(runs, return_counts=True)
        raise DataError(
            f'samples of one segment must lie together, but segment {numbers[counts > 1][0]} '
            'comes back after another; give it a new number.'
        )
    mixed = np.setdiff1d(np.flatnonzero(np.diff(recording)) + 1, begins)
    if mixed.size:
        raise DataError(
            f'a segment must be of one recording, but segment {segment[mixed[0]]} is of '
            f'{recording[mixed[0] - 1]} and {recording[mixed[0]]}; begin a new segment.'
        )
    steps = np.diff(t)
    steps[begins - 1] = 0.0
    if (steps < 0).any():
        at = int(np.argmax(steps < 0))
        raise DataError(
            f't must not decrease within a segment, but goes from {t[at]:g} to {t[at + 1]:g} s '
            f'at sample {at + 1}; sort the samples or begin a new segment.'
        )
