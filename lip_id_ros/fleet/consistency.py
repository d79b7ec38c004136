"""
Recordings that contradict each other, as of an arm with and without a load at its last link.

Quarters of recordings are sorted into two groups by the change of the last link that explains each
best: k-means whose distance is the squared residual (Späth, Computing 22, 1979). The groups are
told where quarters are predicted far better by the others of their group than by all others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.fleet.results import Survey
from lip_id_ros.fleet.survey import gather_kept, reservoir_data
from lip_id_ros.identification.left_out import Gain
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.statistics import contiguous_blocks
from lip_id_ros.identification.total import unpacked
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import BODY

PARTS = 4
"""Of every recording, of equal numbers of samples."""

PRIOR = 1e-3
"""Information of the prior of a change, as a share of what a part has on average."""

SORTINGS, NOISE_ROUNDS = 20, 3
"""Most sortings from one start, and rounds in which the noise is estimated."""

LEAST_GAIN, LEAST_ERRORS = 1.0, 2.0
"""
Least decrease of the logarithms of left-out mean squares, summed over joints, and its least in
standard errors: as of the halves of one recording.
"""


def disagreement(
    surveys: Sequence[Survey], around: Linearisation
) -> tuple[list[str], list[str]] | None:
    """
    Return two groups of recordings that contradict each other, the smaller first.

    Or None. The friction of every part is eliminated.
    """
    if len(surveys) < 2:
        return None
    changes = _Changes.of(surveys, around)
    for _ in range(NOISE_ROUNDS):
        group = changes.sorted()
        changes = changes.with_noise_of(group)
    if not changes.gain(group).is_sure(LEAST_GAIN, LEAST_ERRORS):
        return None
    smaller = group if 2 * group.sum() <= group.size else ~group
    return _names(surveys, smaller), _names(surveys, ~smaller)


def _names(surveys: Sequence[Survey], group: BoolArray) -> list[str]:
    """Return the names of recordings in a group, with times where only a part is in it."""
    names = []
    for survey, some in zip(surveys, group.reshape(-1, PARTS), strict=True):
        rows = np.flatnonzero(some[contiguous_blocks(survey.t.size, PARTS)])
        if some.all():
            names.append(survey.name)
        elif some.any():
            first, last = survey.t[rows[[0, -1]]]
            names.append(f'{survey.name} ({first:.4g} to {last:.4g} s)')
    return sorted(names)


@dataclass(frozen=True, eq=False)
class _Changes:
    """Normal equations of changes of the last link, by U parts of recordings and joints."""

    normal: Array  # (U, n, 10, 10)
    right: Array  # (U, n, 10)
    squares: Array  # (U, n), of residuals without a change
    counts: Array  # (U, n), of samples
    noise_std: Array  # (n,)

    @classmethod
    def of(cls, surveys: Sequence[Survey], around: Linearisation) -> _Changes:
        """Return those of the reservoirs of recordings."""
        taken = np.array([own.size for own, _ in around.columns])
        rows, sizes = [], []
        for survey in surveys:
            data = reservoir_data(survey, around.joint_names)
            part = contiguous_blocks(data.n_samples, PARTS)
            for k in range(PARTS):
                found = gather_kept(data.select(part == k), around)
                rows.append([_last(found.triangles[0], around, i) for i in range(taken.size)])
                sizes.append(np.maximum(found.counts[0] - taken, 1.0))
        grams = np.array([[each.T @ each for each in joints] for joints in rows])
        squares, counts = grams[..., -1, -1], np.array(sizes)
        noise = np.sqrt(squares.sum(axis=0) / counts.sum(axis=0))
        return cls(grams[..., :-1, :-1], grams[..., :-1, -1], squares, counts, noise)

    def with_noise_of(self, group: BoolArray) -> _Changes:
        squares = np.zeros_like(self.squares)
        for some in (group, ~group):
            squares[some] = self.residual_squares(self.solved(some)[0])[some]
        noise = np.sqrt(squares.sum(axis=0) / self.counts.sum(axis=0))
        return replace(self, noise_std=noise)

    def solved(self, some: BoolArray) -> tuple[Array, Array]:
        """Return the change that explains some parts, and its covariance."""
        precision = self.noise_std**-2.0
        every = np.tensordot(precision, self.normal.sum(axis=0), axes=1)
        prior = PRIOR / len(self.normal) * np.diag(every)
        normal = np.tensordot(precision, self.normal[some].sum(axis=0), axes=1) + np.diag(prior)
        covariance = np.linalg.inv(normal)
        return covariance @ (precision @ self.right[some].sum(axis=0)), covariance

    def residual_squares(self, change: Array) -> Array:
        """Return the sums of squared residuals of all parts with a change, (U, n)."""
        return np.asarray(self.squares - 2.0 * self.right @ change + self.normal @ change @ change)

    def sorted(self) -> BoolArray:
        """Return which of two groups each part is in, (U,), the best of a start from each."""
        starts = [self._sorted_from(row) for row in np.eye(len(self.normal), dtype=bool)]
        return min(starts, key=lambda each: each[1])[0]

    def _sorted_from(self, group: BoolArray) -> tuple[BoolArray, float]:
        for _ in range(SORTINGS):
            before = group
            costs = [
                self.residual_squares(self.solved(some)[0]) @ self.noise_std**-2.0
                for some in (~group, group)
            ]
            group = costs[1] < costs[0]
            if np.array_equal(group, before):
                break
        return group, float(np.minimum(*costs).sum())

    def gain(self, group: BoolArray) -> Gain:
        """Return how much better parts are predicted by their group than by all."""
        now, other = np.empty_like(self.squares), np.empty_like(self.squares)
        for u in range(len(group)):
            rest = np.arange(len(group)) != u
            now[u] = self.residual_squares(self.solved(rest)[0])[u]
            other[u] = self.residual_squares(self.solved(rest & (group == group[u]))[0])[u]
        return Gain.between([now / self.counts], [other / self.counts])


def _last(triangles: Array, around: Linearisation, joint: int) -> Array:
    """Return rows of the last link's parameters and of the residual, without friction."""
    own, others = around.columns[joint]
    rest = unpacked(triangles, around, joint)[own.size :, own.size :]
    known = np.zeros(around.size)
    known[-around.links.size :] = around.links.ravel()
    residual = rest[:, -1] - rest[:, :-1] @ known[others]
    body = rest.shape[1] - 1 - LINK_PARAMETERS
    return np.column_stack([rest[:, body : body + BODY], residual])
