"""Weighted rows of one joint, column by column, from the features of all joints by kinds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, IndexArray, IntArray
from lip_id_ros.numba_jit import jit, jit_inlined

TILE = 16
"""Samples whose columns are copied together: those of eight columns share a line of the cache."""


@dataclass(frozen=True, eq=False)
class JointRows:
    """The rows [features, torque] of N samples, times the root of their weights."""

    parts: tuple[Array, Array, Array]  # features (N, n, p) of all joints by kinds
    joint: int
    columns: IndexArray  # (s - 1,), of all kinds
    target: Array  # (N, n)
    root: Array  # (N, n)

    def all(self) -> Array:
        """Return the rows (N, s), in Fortran order."""
        size = self.columns.size + 1
        return self.some(np.arange(size), np.zeros(size))[0]

    def some(self, columns: IndexArray, check: Array) -> tuple[Array, Array]:
        """Return some columns of the rows, in Fortran order, and products (N,) with (s,)."""
        place = np.full(check.size, -1)
        place[columns] = np.arange(columns.size)
        out, products = np.empty((columns.size, len(self.root))), np.zeros(len(self.root))
        _set_rows(
            out,
            products,
            *self.parts,
            self.joint,
            self.columns,
            self.target,
            self.root,
            place,
            check,
        )
        return out.T, products


@jit
def _set_rows(
    out: Array,
    products: Array,
    friction: Array,
    placements: Array,
    links: Array,
    joint: int,
    columns: IndexArray,
    target: Array,
    root: Array,
    place: IntArray,
    check: Array,
) -> None:
    ends = friction.shape[2], friction.shape[2] + placements.shape[2]
    last = len(columns)
    for begin in range(0, len(root), TILE):
        end = min(begin + TILE, len(root))
        for c in range(last):
            k = columns[c]
            for t in range(begin, end):
                if k < ends[0]:
                    value = friction[t, joint, k]
                elif k < ends[1]:
                    value = placements[t, joint, k - ends[0]]
                else:
                    value = links[t, joint, k - ends[1]]
                _set(out, products, place[c], t, check[c], value * root[t, joint])
        for t in range(begin, end):
            value = target[t, joint] * root[t, joint]
            _set(out, products, place[last], t, check[last], value)


@jit_inlined
def _set(out: Array, products: Array, place: int, t: int, share: float, value: float) -> None:
    products[t] += share * value
    if place >= 0:
        out[place, t] = value
