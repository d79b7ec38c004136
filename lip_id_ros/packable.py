"""Dataclasses that processes, caches and files take as bytes."""

from __future__ import annotations

from dataclasses import dataclass, fields
import json
import math
from typing import Any, ClassVar, Self

import numpy as np

from lip_id_ros.errors import DataError


@dataclass(frozen=True, eq=False)
class Packable:
    """A dataclass of arrays, texts and numbers that is stored as bytes, without pickle."""

    KIND: ClassVar[str]
    """Name of such results in a cache."""

    def to_bytes(self) -> bytes:
        """Return a line of JSON, then the numbers of all arrays; `from_bytes` reads it."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays = {name: x for name, x in values.items() if isinstance(x, np.ndarray)}
        texts = {name: x for name, x in values.items() if name not in arrays}
        shapes = {name: (x.dtype.str, x.shape) for name, x in arrays.items()}
        head = json.dumps([texts, shapes]).encode()
        return b'\n'.join([head, b''.join(x.tobytes() for x in arrays.values())])

    @classmethod
    def from_bytes(cls, content: bytes) -> Self:
        """Return the object that `to_bytes` gave; DataError if an entry is missing or damaged."""
        head, _, rest = content.partition(b'\n')
        try:
            texts, shapes = json.loads(head)
            values = {name: _immutable(value) for name, value in texts.items()}
            at = 0
            for name, (kind, shape) in shapes.items():
                count = math.prod(shape)
                flat = np.frombuffer(rest, kind, count, at).copy()  # aligned, not read-only
                at += flat.nbytes
                values[name] = flat.reshape(shape)
            return cls(**values)
        except (TypeError, ValueError) as error:
            raise DataError(
                f'a {cls.__name__} with all of its entries was expected, but the stored bytes '
                f'are damaged ({error}); make it anew.'
            ) from error


def _immutable(value: Any) -> Any:
    return tuple(map(_immutable, value)) if isinstance(value, list) else value
