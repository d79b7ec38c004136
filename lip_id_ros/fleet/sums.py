"""Statistics of all recordings, summed in a fixed tree, and the system to solve for links."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import solve_triangular

from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.fleet.friction_deviations import NestedEffects
from lip_id_ros.fleet.recording_statistics import Regression, unpacked
from lip_id_ros.fleet.results import RecordingStatistics
from lip_id_ros.identification.statistics import TorqueStatistics, triangular

LEFT_OUT_PARTS = 6


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
        self._groups = list(groups)
        self.group: IntArray = np.unique(self._groups, return_inverse=True)[1].astype(np.int64)
        self.n_links, self.n_friction = regression.links.size, regression.n_friction
        factors = [unpacked(each, regression) for each in recordings]
        self._tops = [tops for tops, _ in factors]
        self._rests = [rests for _, rests in factors]
        weights = [each.weights for each in recordings]
        self.recording_weights = np.reshape(weights, (-1, regression.n_joints))

    @property
    def weights(self) -> Array:
        """Sums of the weights of all samples, shape (n,)."""
        return np.asarray(self.recording_weights.sum(axis=0))

    def select(self, some: BoolArray) -> FleetStatistics:
        """Return the statistics of some of the recordings."""
        rows = np.flatnonzero(some).tolist()
        recordings, groups = [self.recordings[r] for r in rows], [self._groups[r] for r in rows]
        return FleetStatistics(self.regression, recordings, groups)

    @cached_property
    def parts(self) -> list[TorqueStatistics]:
        """Sums of the links' triangles over contiguous parts of the recordings."""
        count = min(LEFT_OUT_PARTS, len(self.recordings))
        ends = np.linspace(0, len(self.recordings), count + 1).round().astype(int)
        return [tree_sum([self._links(r) for r in range(a, b)]) for a, b in pairwise(ends)]

    @cached_property
    def links(self) -> TorqueStatistics:
        """Sum of the links' triangles over all recordings."""
        return tree_sum(self.parts)

    def _links(self, recording: int) -> TorqueStatistics:
        """Return the triangles of links, with the degrees of freedom that friction leaves."""
        columns = self.regression.columns()
        taken = np.array([own.size for own, _ in columns])
        weights = np.maximum(self.recordings[recording].weights - taken, 0.0)
        links = tuple(links for _, links in columns)
        return TorqueStatistics(links, tuple(self._rests[recording]), weights)

    def friction_rows(self, recording: int, noise_std: Array) -> Array:
        """
        Return all rows of a recording that have its friction in them, in units of the noise.

        Returns
        -------
        array, shape (sum of k_i, K + 11 n + 1)
            Columns of friction, links and torque.

        """
        blocks = []
        for joint, (own, links) in enumerate(self.regression.columns()):
            block = np.zeros((own.size, self.n_friction + self.n_links + 1))
            top = self._tops[recording][joint] / noise_std[joint]
            block[:, own] = top[:, : own.size]
            block[:, self.n_friction + links] = top[:, own.size : -1]
            block[:, -1] = top[:, -1]
            blocks.append(block)
        return np.concatenate(blocks)

    def feature_squares(self, recording: int) -> Array:
        """Return weighted sums of squared friction features of a recording, shape (n, K)."""
        out = np.zeros((self.regression.n_joints, self.n_friction))
        for joint, (own, _) in enumerate(self.regression.columns()):
            out[joint, own] = np.sum(self._tops[recording][joint][:, : own.size] ** 2, axis=0)
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
            own = np.flatnonzero(self.group == number)
            rows = [
                self._whitened(self.friction_rows(r, noise_std), deviations.recordings)
                for r in own.tolist()
            ]
            blocks.append(self._whitened(triangular(*rows), deviations.groups))
        return triangular(*blocks)

    def _whitened(self, rows: Array, deviations: Array) -> Array:
        """Return rows whose noise has random effects of friction in it, in its units."""
        if not deviations.any():
            return rows
        scaled = rows[:, : self.n_friction] * deviations
        covariance = np.eye(len(rows)) + scaled @ scaled.T
        lower = np.linalg.cholesky(covariance)
        return np.asarray(solve_triangular(lower, rows, lower=True))

    def effects(self, noise_std: Array, links: Array, friction: Array) -> NestedEffects:
        """Return the normal equations of every recording's friction, with links given."""
        size = self.n_friction
        normal = np.zeros((len(self.recordings), size, size))
        right = np.zeros((len(self.recordings), size))
        for r in range(len(self.recordings)):
            rows = self.friction_rows(r, noise_std)
            features = rows[:, : self.n_friction]
            residual = rows[:, -1] - rows[:, self.n_friction : -1] @ links.ravel()
            normal[r] = features.T @ features
            right[r] = features.T @ (residual - features @ friction)
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
        out = np.zeros((len(self.recordings), self.regression.n_joints))
        vector = links.ravel()
        for r, (tops, rests) in enumerate(zip(self._tops, self._rests, strict=True)):
            for joint, (own, column) in enumerate(self.regression.columns()):
                x = np.concatenate([friction[r, own], vector[column], [-1.0]])
                rest = rests[joint] @ x[own.size :]
                out[r, joint] = np.sum((tops[joint] @ x) ** 2) + rest @ rest
        return out
