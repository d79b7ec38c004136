"""Statistics of all recordings, summed in a fixed tree, and the system to solve for links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.fleet.recording_statistics import friction_blocks, link_triangles, Regression
from lip_id_ros.fleet.results import RecordingStatistics
from lip_id_ros.identification.friction_deviations import NestedEffects
from lip_id_ros.identification.statistics import TorqueStatistics, triangular

LEFT_OUT_PARTS = 6

TOGETHER = 32
"""Recordings whose rows are in memory, and are triangularised, together."""


def tree_sum(parts: Sequence[TorqueStatistics]) -> TorqueStatistics:
    """Merge statistics in pairs, pairs of pairs and so on: the tree depends on their number."""
    if len(parts) == 1:
        return parts[0]
    half = len(parts) // 2
    return tree_sum(parts[:half]).merge(tree_sum(parts[half:]))


@dataclass(frozen=True, eq=False)
class FrictionDeviations:
    """
    Standard deviations of coefficients of friction.

    Attributes
    ----------
    recordings, groups : arrays, shape (K,)
        Between recordings of one robot, and between robots; 0 where they do not differ.

    """

    recordings: Array
    groups: Array

    @property
    def total(self) -> Array:
        """Of a recording of a robot that is not known, shape (K,)."""
        return np.hypot(self.recordings, self.groups)


class FleetStatistics:
    """
    Statistics of all recordings that are in the fit.

    Parameters
    ----------
    regression : Regression
        That the statistics were gathered with.
    recordings : sequence of RecordingStatistics
        In the order of their keys, so that the order of the sources plays no role.
    groups : sequence of str
        Robot of each.

    """

    def __init__(
        self,
        regression: Regression,
        recordings: Sequence[RecordingStatistics],
        groups: Sequence[str],
    ) -> None:
        self.regression, self.recordings = regression, list(recordings)
        self._groups, self._columns = list(groups), regression.columns()
        self.group: IntArray = np.unique(self._groups, return_inverse=True)[1].astype(np.int64)
        self.n_links, self.n_friction = regression.links.size, regression.n_friction
        counts = [each.counts for each in recordings]
        self.recording_counts = np.reshape(counts, (-1, regression.n_joints))
        self._link_factors = _stacked([each.link_factors for each in recordings])
        rows = _stacked([each.friction_rows for each in recordings])
        self._tops = friction_blocks(rows, regression)

    @property
    def counts(self) -> Array:
        """Numbers of samples, shape (n,)."""
        return np.asarray(self.recording_counts.sum(axis=0))

    def select(self, some: BoolArray) -> FleetStatistics:
        """Return the statistics of some of the recordings."""
        rows = np.flatnonzero(some).tolist()
        recordings, groups = [self.recordings[r] for r in rows], [self._groups[r] for r in rows]
        return FleetStatistics(self.regression, recordings, groups)

    @cached_property
    def parts(self) -> list[TorqueStatistics]:
        """Sums of the links' triangles over contiguous parts of the recordings."""
        every = np.arange(len(self.recordings))
        return [
            tree_sum([self._links(some) for some in _together(part)])
            for part in np.array_split(every, min(LEFT_OUT_PARTS, every.size))
        ]

    @cached_property
    def links(self) -> TorqueStatistics:
        """Sum of the links' triangles over all recordings."""
        return tree_sum(self.parts)

    def _links(self, some: IndexArray) -> TorqueStatistics:
        """Return the sum of triangles, with the degrees of freedom that friction leaves."""
        taken = np.array([own.size for own, _ in self._columns])
        counts = np.maximum(self.recording_counts[some] - taken, 0.0).sum(axis=0)
        rests = link_triangles(self._link_factors[some], self.regression)
        factors = tuple(triangular(rest.reshape(-1, rest.shape[2])) for rest in rests)
        return TorqueStatistics(tuple(links for _, links in self._columns), factors, counts)

    def feature_squares(self) -> Array:
        """Return weighted sums of squared friction features of all recordings, shape (n, K)."""
        out = np.zeros((self.regression.n_joints, self.n_friction))
        for joint, (own, _) in enumerate(self._columns):
            out[joint, own] = np.sum(self._tops[joint][..., : own.size] ** 2, axis=(0, 1))
        return out

    def system(self, noise_std: Array, deviations: FrictionDeviations) -> Array:
        """
        Return the triangular system of mean friction and links.

        Parameters
        ----------
        noise_std : array, shape (n,)
            [N m or N].
        deviations : FrictionDeviations

        Returns
        -------
        array, shape (K + 11 n + 1, K + 11 n + 1)
            Columns of friction, links and torque.

        """
        rest = self.links.system(noise_std, np.arange(self.n_links))
        blocks = [np.hstack([np.zeros((len(rest), self.n_friction)), rest])]
        for number in range(int(self.group.max()) + 1):
            robot = np.zeros((0, self.n_friction + self.n_links + 1))
            for some in _together(np.flatnonzero(self.group == number)):
                rows = self._whitened(self._rows(some, noise_std), deviations.recordings)
                robot = triangular(robot, rows.reshape(-1, robot.shape[1]))
            blocks.append(self._whitened(robot, deviations.groups))
        return triangular(*blocks)

    def _rows(self, some: IndexArray, noise_std: Array) -> Array:
        """
        Return all rows of recordings that have their friction in them, in units of the noise.

        Returns
        -------
        array, shape (r, sum of k_i, K + 11 n + 1)
            Columns of friction, links and torque.

        """
        size = sum(own.size for own, _ in self._columns)
        out, at = np.zeros((some.size, size, self.n_friction + self.n_links + 1)), 0
        for top, (own, links), std in zip(self._tops, self._columns, noise_std, strict=True):
            columns = np.concatenate([own, self.n_friction + links, [-1]])
            out[:, at : at + own.size, columns] = top[some] / std
            at += own.size
        return out

    def _whitened(self, rows: Array, deviations: Array) -> Array:
        """Return rows (..., m, p) whose noise has random effects of friction, in its units."""
        if not deviations.any():
            return rows
        scaled = rows[..., : self.n_friction] * deviations
        covariance = np.eye(rows.shape[-2]) + scaled @ scaled.swapaxes(-1, -2)
        return np.asarray(np.linalg.solve(np.linalg.cholesky(covariance), rows))

    def effects(self, noise_std: Array, links: Array, friction: Array) -> NestedEffects:
        """Return the normal equations of every recording's friction, with links given."""
        count, size = len(self.recordings), self.n_friction
        normal, right = np.zeros((count, size, size)), np.zeros((count, size))
        for top, (own, column), std in zip(self._tops, self._columns, noise_std, strict=True):
            features = top[..., : own.size] / std
            known = np.concatenate([friction[own], links.ravel()[column], [-1.0]])
            residual = -top @ known / std
            normal[:, own[:, None], own] += features.swapaxes(1, 2) @ features
            right[:, own] += np.einsum('rik,ri->rk', features, residual)
        return NestedEffects(normal, right, self.group)

    def residual_squares(self, links: Array, friction: Array) -> Array:
        """
        Return sums of squared residuals of every recording with its own friction.

        Parameters
        ----------
        links : array, shape (n, 11)
        friction : array, shape (R, K)

        Returns
        -------
        array, shape (R, n)
            [(N m)^2 or N^2].

        """
        out, vector = np.zeros(self.recording_counts.shape), np.append(links, -1.0)
        for some in _together(np.arange(len(self.recordings))):
            rests = link_triangles(self._link_factors[some], self.regression)
            for joint, (own, column) in enumerate(self._columns):
                known, top = vector[np.append(column, -1)], self._tops[joint][some]
                residual = top[..., own.size :] @ known
                residual += np.einsum('rik,rk->ri', top[..., : own.size], friction[some][:, own])
                squares = np.sum(residual**2, axis=1)
                out[some, joint] = squares + np.sum((rests[joint] @ known) ** 2, axis=1)
        return out


def _stacked(rows: Sequence[Array]) -> Array:
    return np.array(rows) if rows else np.zeros((0, 0))


def _together(some: IndexArray) -> list[IndexArray]:
    return np.array_split(some, -(-some.size // TOGETHER)) if some.size else []
