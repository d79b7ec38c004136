"""
What a method learned as arrays and JSON, field by field, without pickle.

Every object is a list entry with the name of its class and its fields; a class that is made of
something else than numbers and such objects has `__getstate__` and `__setstate__`. Only classes
of the places in `HOMES` are made again, so that a file can name no other code.

"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

HOMES = ('lip_id_ros.baselines.', 'lip_id_ros.kernels.')

Arrays = dict[str, NDArray[Any]]


def take_apart(learned: object) -> tuple[Arrays, list[Any]]:
    """
    Return arrays by name, and JSON-able entries of all objects; the last is `learned`.

    Raises
    ------
    TypeError
        If something in it is neither a number, a text, an array nor an object of `HOMES`.

    """
    parts = _Parts()
    parts.encoded(learned)
    return parts.arrays, parts.entries


def put_together(arrays: Mapping[str, NDArray[Any]], entries: list[Any]) -> Any:
    """
    Return what was taken apart.

    Raises
    ------
    KeyError, TypeError, ValueError
        If the entries do not describe objects of `HOMES`.

    """
    objects: list[Any] = []
    for entry in entries:
        fields = _decoded(entry['fields'], arrays, objects)
        objects.append(_made(_class(entry['class']), fields))
    return objects[-1]


class _Parts:
    """Arrays and entries found so far; an object that is met twice is kept once."""

    def __init__(self) -> None:
        self.arrays: Arrays = {}
        self.entries: list[Any] = []
        self._numbers: dict[int, int] = {}

    def encoded(self, value: Any) -> Any:
        if value is None or isinstance(value, (bool, int, float, str)):
            return value
        if isinstance(value, np.ndarray):
            return {'array': self._array(value)}
        if _is_tensor(value):
            return {'tensor': self._array(value.numpy())}
        if type(value) in (list, tuple):
            return {type(value).__name__: [self.encoded(part) for part in value]}
        if isinstance(value, Mapping):
            return {'dict': {name: self.encoded(part) for name, part in value.items()}}
        return {'object': self._object(value)}

    def _array(self, values: NDArray[Any]) -> str:
        name = f'array_{len(self.arrays)}'
        self.arrays[name] = values
        return name

    def _object(self, value: object) -> int:
        if id(value) not in self._numbers:
            name = f'{type(value).__module__}:{type(value).__name__}'
            _class(name)
            fields = self.encoded(value.__getstate__() or {})
            self.entries.append({'class': name, 'fields': fields})
            self._numbers[id(value)] = len(self.entries) - 1
        return self._numbers[id(value)]


def _decoded(content: Any, arrays: Mapping[str, NDArray[Any]], objects: list[Any]) -> Any:
    if not isinstance(content, dict):
        return content
    ((kind, value),) = content.items()
    match kind:
        case 'array':
            return arrays[value]
        case 'tensor':
            import torch

            return torch.from_numpy(arrays[value])
        case 'list' | 'tuple':
            parts = (_decoded(part, arrays, objects) for part in value)
            return list(parts) if kind == 'list' else tuple(parts)
        case 'dict':
            return {name: _decoded(part, arrays, objects) for name, part in value.items()}
        case 'object':
            return objects[value]
    raise ValueError(f'a part of the unknown kind {kind!r}')


def _class(name: str) -> type:
    module, _, short = name.partition(':')
    if not f'{module}.'.startswith(HOMES):
        raise TypeError(f'the class {name}, which is not of this package')
    found = getattr(import_module(module), short, None)
    if not isinstance(found, type) or found.__module__ != module:
        raise TypeError(f'the class {name}, which is not there')
    return found


def _made(kind: type, fields: dict[str, Any]) -> Any:
    made: Any = object.__new__(kind)
    restore = getattr(made, '__setstate__', vars(made).update)
    restore(fields)
    return made


def _is_tensor(value: object) -> bool:
    return type(value).__module__.split('.')[0] == 'torch'
