"""
Files of the literature's models: the name and version of a method, and its state, without pickle.

A state is a tree of mappings, lists, numbers and texts, whose arrays are stored beside it.

"""

from __future__ import annotations

from collections.abc import Mapping
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.baselines.interface import Baseline, FitRecord
from lip_id_ros.baselines.registry import LITERATURE, restore
from lip_id_ros.errors import DataError, ModelError
from lip_id_ros.model.checked_file import (
    Arrays,
    COMPARED,
    contradiction,
    read_checked,
    write_checked,
)

VERSION = 2
ARRAY = 'array'
CONTRADICTIONS = (
    *(AttributeError, KeyError, IndexError, RuntimeError, TypeError, ValueError),
    *(DataError, ModelError),
)


def save(path: str | os.PathLike[str], model: Baseline) -> None:
    """
    Write a model into one npz file, whole or not at all.

    Raises
    ------
    OSError
        If the file cannot be written.
    TypeError
        If the state of the model has something other than numbers, texts and arrays.

    """
    arrays: Arrays = {}
    record = model.record
    header = {
        'method': record.method,
        'method_version': LITERATURE[record.method].version,
        'joint_names': list(model.joint_names),
        'joint_types': list(model.joint_types),
        'n_samples': record.n_samples,
        'fit_seconds': record.seconds,
        'provenance': dict(record.provenance),
        'state': flattened(model.state(), arrays),
    }
    write_checked(path, COMPARED, VERSION, arrays, header)


def load(path: str | os.PathLike[str]) -> Baseline:
    """
    Read a model.

    Raises
    ------
    OSError
        If the file does not exist or cannot be opened.
    ModelError
        If it is damaged, is not such a model, or comes from another version.
    LipIdError
        If a package that the method needs is missing.

    """
    arrays, header = read_checked(path, COMPARED, VERSION)
    try:
        _check_method(header['method'], header['method_version'])
        joints = tuple(header['joint_names']), tuple(header['joint_types'])
        model = restore(header['method'], joints, rebuilt(header['state'], arrays))
        model.record = FitRecord(
            header['method'],
            int(header['n_samples']),
            float(header['fit_seconds']),
            dict(header['provenance']),
        )
    except CONTRADICTIONS as error:
        raise contradiction(path, error) from error
    return model


def flattened(value: Any, arrays: Arrays) -> Any:
    """
    Return a state as JSON; its arrays are added to `arrays` and referred to by name.

    Raises
    ------
    TypeError
        If something in it is neither a number, a text, an array, a list nor a mapping.

    """
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray):
        name = f'{ARRAY}_{len(arrays)}'
        arrays[name] = value
        return {ARRAY: name}
    if isinstance(value, (list, tuple)):
        return [flattened(part, arrays) for part in value]
    if isinstance(value, Mapping):
        return {'items': {name: flattened(part, arrays) for name, part in value.items()}}
    raise TypeError(f'a state of numbers, texts and arrays was expected, not {type(value)}')


def rebuilt(content: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """
    Return the state that was flattened.

    Raises
    ------
    KeyError, TypeError, ValueError
        If the content is not a flattened state, or an array is missing.

    """
    if isinstance(content, list):
        return [rebuilt(part, arrays) for part in content]
    if not isinstance(content, dict):
        return content
    ((kind, value),) = content.items()
    if kind == ARRAY:
        return arrays[value]
    if kind == 'items':
        return {name: rebuilt(part, arrays) for name, part in value.items()}
    raise ValueError(f'a part of the unknown kind {kind!r}')


def _check_method(name: str, version: int) -> None:
    if name not in LITERATURE:
        raise ModelError(f'the unknown method {name!r}')
    if version != LITERATURE[name].version:
        raise ModelError(f'version {version!r} of the method {name!r}, which is not known here')
