"""
Square-root statistics of recordings, for block angular least squares (maths.md, section 14).

The first rows of each factor have the friction of its recording in them; the rest adds up over
recordings (Björck, Numerical Methods for Least Squares Problems, 1996, 6.3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.checked_file import Packable
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.factor_sum import statistics_of
from lip_id_ros.identification.folds import recurrent_folds
from lip_id_ros.identification.friction_deviations import NestedEffects
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.statistics import TorqueStatistics, triangular


@dataclass(frozen=True, eq=False)
class RecordingFactors(Packable):
    """
    Statistics of the B blocks of a recording.

    Triangles are the upper ones of the joints' factors, row by row.
    """

    KIND = 'statistics'
    triangles: Array  # (B, sum of (k_i + p_i + 1) (k_i + p_i + 2) / 2)
    counts: Array  # (B, n)


def gather(
    dataset: Dataset, around: Linearisation, blocks: int = 1, kept: BoolArray | None = None
) -> RecordingFactors:
    """
    Gather the statistics of the samples of a recording that are kept.

    Blocks are of motions with their repetitions, at most so many.
    """
    rows = np.arange(dataset.n_samples) if kept is None else np.flatnonzero(kept)
    number = recurrent_folds(dataset.select(rows), blocks) if rows.size else rows
    count = int(number.max()) + 1 if number.size else 1
    found = [statistics_of(dataset, rows[number == k], around) for k in range(count)]
    return RecordingFactors(
        np.array([packed(each.factors) for each in found]),
        np.array([each.counts for each in found]),
    )


def packed(factors: Sequence[Array]) -> Array:
    """Return the upper triangles of the joints' factors, one after another."""
    return np.concatenate([factor[np.triu_indices(len(factor))] for factor in factors])


def unpacked(triangles: Array, around: Linearisation, joint: int) -> Array:
    """Return the factors of a joint, (..., s, s), of triangles of all joints."""
    sizes = [own.size + others.size + 1 for own, others in around.columns]
    lengths = [size * (size + 1) // 2 for size in sizes]
    at, size = sum(lengths[:joint]), sizes[joint]
    factor = np.zeros((*triangles.shape[:-1], size, size))
    factor[..., *np.triu_indices(size)] = triangles[..., at : at + lengths[joint]]
    return factor


FOLDS = 6
"""Parts that are left out: of the recordings, or of the time of a single one."""

MOST_LEFT_OUT = 2.0 / 3.0
"""
Share of all samples that a recording has at most to be left out whole. Of a longer one blocks are:
the others would hardly predict it.
"""

TOGETHER = 32
"""Recordings whose factors are triangularised together."""


@dataclass(frozen=True, eq=False)
class FrictionDeviations:
    """Standard deviations of coefficients of friction; 0 where they do not differ."""

    recordings: Array  # (K,), between recordings of one robot
    groups: Array  # (K,), between robots

    @classmethod
    def none(cls, size: int) -> FrictionDeviations:
        """Return those of friction that is the same in all recordings."""
        return cls(np.zeros(size), np.zeros(size))

    @property
    def total(self) -> Array:
        """Of a recording of a robot that is not known, shape (K,)."""
        return np.hypot(self.recordings, self.groups)


class Total:
    """
    Statistics of all recordings that are in the fit, gathered with `around`.

    Their order does not depend on that of the sources; groups are robots.
    """

    def __init__(
        self,
        around: Linearisation,
        recordings: Sequence[RecordingFactors],
        groups: Sequence[str] | None = None,
    ) -> None:
        self.around, self.recordings = around, list(recordings)
        self._groups = [''] * len(recordings) if groups is None else list(groups)
        self.group: IntArray = np.unique(self._groups, return_inverse=True)[1].astype(np.int64)
        self._triangles = np.array([_merged(each, around) for each in self.recordings])
        counts = [each.counts.sum(axis=0) for each in self.recordings]
        self.recording_counts = np.reshape(counts, (-1, around.n_joints))

    @property
    def counts(self) -> Array:
        """Numbers of samples, shape (n,)."""
        return np.asarray(self.recording_counts.sum(axis=0))

    def select(self, some: BoolArray) -> Total:
        """Return the statistics of some of the recordings."""
        rows = np.flatnonzero(some).tolist()
        recordings, groups = [self.recordings[r] for r in rows], [self._groups[r] for r in rows]
        return Total(self.around, recordings, groups)

    def merged(self, noise_std: Array, deviations: FrictionDeviations) -> TorqueStatistics:
        """
        Return the statistics of all recordings, whitened by the effects of friction.

        Rows of friction have a noise of their own that these effects make; in its units their
        squares add up to those of generalised least squares.
        """
        merged = []
        robots = range(int(self.group.max()) + 1)
        for joint, (own, _) in enumerate(self.around.columns):
            within = deviations.recordings[own] / noise_std[joint]
            between = deviations.groups[own] / noise_std[joint]
            rows = [
                self._whitened(self._triangles[self.group == g], joint, within) for g in robots
            ]
            merged.append(triangular(*(_whitened(each[None], between)[0] for each in rows)))
        return self._statistics(merged, self.counts)

    def folds(self, noise_std: Array, deviations: FrictionDeviations) -> list[TorqueStatistics]:
        """Return the statistics of parts that are left out, whitened likewise."""
        one = len(self.recordings) == 1
        total = np.zeros(self.around.n_friction) if one else deviations.total
        triangles, counts = self._triangles, self.recording_counts
        longest = int(np.argmax(counts[:, 0]))
        if has_most(counts[:, 0]):
            blocks, others = self.recordings[longest], np.arange(len(counts)) != longest
            triangles = np.concatenate([blocks.triangles, triangles[others]])
            counts = np.concatenate([blocks.counts, counts[others]])
        rows = np.arange(len(counts))
        parts = [part.tolist() for part in np.array_split(rows, min(FOLDS, rows.size))]
        return [
            self._statistics(
                [
                    self._whitened(triangles[part], joint, total[own] / noise_std[joint])
                    for joint, (own, _) in enumerate(self.around.columns)
                ],
                counts[part].sum(axis=0),
            )
            for part in parts
        ]

    def _whitened(self, triangles: Array, joint: int, deviations: Array) -> Array:
        """Return the factor of a joint of all of some recordings, whose friction differs."""
        factors = (
            _sum(_whitened(unpacked(part, self.around, joint), deviations))
            for part in np.array_split(triangles, -(-len(triangles) // TOGETHER))
        )
        return triangular(*factors)

    def _statistics(self, factors: Sequence[Array], counts: Array) -> TorqueStatistics:
        columns = tuple(np.concatenate(own) for own in self.around.columns)
        return TorqueStatistics(columns, tuple(factors), counts)

    @cached_property
    def feature_squares(self) -> Array:
        """Weighted sums of squared features of friction, shape (n, K)."""
        out = np.zeros((self.around.n_joints, self.around.n_friction))
        for joint, _, own, factor in self._every():
            out[joint, own] += np.sum(factor[:, :, : own.size] ** 2, axis=(0, 1))
        return out

    def effects(self, noise_std: Array, parameters: Array) -> NestedEffects:
        """Return the normal equations of every recording's friction, other parameters given."""
        count, size = len(self.recordings), self.around.n_friction
        normal, right = np.zeros((count, size, size)), np.zeros((count, size))
        for joint, some, own, factor in self._every():
            features = factor[..., : own.size] / noise_std[joint]
            known = np.append(parameters[np.concatenate(self.around.columns[joint])], -1.0)
            residual = -factor @ known / noise_std[joint]
            normal[some[:, None, None], own[:, None], own] += features.swapaxes(1, 2) @ features
            right[some[:, None], own] += np.einsum('rik,ri->rk', features, residual)
        return NestedEffects(normal, right, self.group)

    def residual_squares(self, parameters: Array, friction: Array) -> Array:
        """
        Return sums of squares (R, n) of every recording with its own friction (R, K).

        Parameters (K + W + 17 n,) are those of a linearisation.
        """
        out = np.zeros(self.recording_counts.shape)
        for joint, some, own, factor in self._every():
            others = self.around.columns[joint][1]
            residual = factor[..., own.size :] @ np.append(parameters[others], -1.0)
            mine = friction[some[:, None], own]
            residual += np.einsum('rik,rk->ri', factor[..., : own.size], mine)
            out[some, joint] = np.sum(residual**2, axis=1)
        return out

    def _every(self) -> Iterator[tuple[int, IndexArray, IndexArray, Array]]:
        """Yield joints, some recordings, coefficients of friction, and factors (r, s, s)."""
        if not self.recordings:
            return
        rows = np.arange(len(self.recordings))
        for some in np.array_split(rows, -(-rows.size // TOGETHER)):
            for joint, (own, _) in enumerate(self.around.columns):
                yield joint, some, own, unpacked(self._triangles[some], self.around, joint)


def has_most(counts: Array | IntArray) -> bool:
    """Return whether a recording has more samples, of (R,), than are left out."""
    return bool(np.max(counts) > MOST_LEFT_OUT * np.sum(counts))


def _merged(recording: RecordingFactors, around: Linearisation) -> Array:
    """Return the triangles of all blocks of a recording."""
    if len(recording.triangles) == 1:
        return np.asarray(recording.triangles[0])
    joints = range(around.n_joints)
    return packed([triangular(*unpacked(recording.triangles, around, i)) for i in joints])


def _sum(factors: Array) -> Array:
    """Return the factor of all rows of factors, (r, s, s), in a tree that depends on r alone."""
    if len(factors) == 1:
        return np.asarray(factors[0])
    half = len(factors) // 2
    return triangular(_sum(factors[:half]), _sum(factors[half:]))


def _whitened(factors: Array, deviations: Array) -> Array:
    """
    Return factors (r, s, s) in units of a noise that has effects of the first columns in it.

    Deviations, shape (k,), are in units of the noise without them. Only the first k rows have
    these columns.
    """
    if not deviations.any():
        return factors
    count = deviations.size
    top = factors[:, :count]
    scaled = top[..., :count] * deviations
    covariance = np.eye(count) + scaled @ scaled.swapaxes(-1, -2)
    out = factors.copy()
    out[:, :count] = np.linalg.solve(np.linalg.cholesky(covariance), top)
    return out
