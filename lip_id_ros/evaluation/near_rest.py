"""Errors in motion, and near rest: there friction depends on how a joint came to where it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, BoolArray

NEAR_REST = 0.05
"""A joint is near rest below this share of the root mean square of its velocity."""


@dataclass(frozen=True)
class RestErrors:
    """
    Root mean square errors of joints in motion and near rest, per joint.

    Attributes
    ----------
    near_rest_percent : tuple of float
        Share of the samples at which a joint is near rest.
    in_motion, near_rest : tuple of float
        [N m or N]; nan where there are no such samples.

    """

    near_rest_percent: tuple[float, ...]
    in_motion: tuple[float, ...]
    near_rest: tuple[float, ...]

    @classmethod
    def of(cls, error: Array, dq: Array) -> RestErrors:
        """Return the errors of torques (N, n) at velocities (N, n) of one data set."""
        rests, squares = near_rest(dq).astype(np.float64), np.square(error)
        motion, rest = (
            _root(np.sum(some * squares, axis=0), some.sum(axis=0))
            for some in (1.0 - rests, rests)
        )
        return cls(tuple((100.0 * rests.mean(axis=0)).tolist()), motion, rest)

    @classmethod
    def merged(cls, parts: Sequence[RestErrors], counts: Array) -> RestErrors:
        """Return the errors of several data sets together, of so many samples each."""
        rests = counts[:, None] * np.array([each.near_rest_percent for each in parts]) / 100.0
        moves = counts[:, None] - rests
        motion, rest = (
            _root(np.sum(_squares(weight, values), axis=0), weight.sum(axis=0))
            for weight, values in (
                (moves, [each.in_motion for each in parts]),
                (rests, [each.near_rest for each in parts]),
            )
        )
        percent = 100.0 * rests.sum(axis=0) / counts.sum()
        return cls(tuple(percent.tolist()), motion, rest)


def near_rest(dq: Array) -> BoolArray:
    """Mark the samples at which joints are near rest, shape (N, n)."""
    usual = np.sqrt(np.mean(np.square(dq), axis=0))
    return np.asarray((np.abs(dq) < NEAR_REST * usual) | (usual == 0.0))


def _root(sums: Array, counts: Array) -> tuple[float, ...]:
    known = counts > 0.0
    means = np.where(known, sums / np.where(known, counts, 1.0), np.nan)
    return tuple(np.sqrt(means).tolist())


def _squares(weight: Array, values: Sequence[tuple[float, ...]]) -> Array:
    """Return sums of squares of parts from their roots, none where a part has no samples."""
    return np.where(weight > 0.0, weight * np.square(values), 0.0)
