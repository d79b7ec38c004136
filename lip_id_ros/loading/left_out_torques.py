"""
The prediction of left-out efforts, by which settings of preprocessing are compared.

Links with friction are linear in their parameters once the joints are placed. They are fitted to
all but one block of a recording, preprocessed by a setting, and predict the efforts of that block.
These are the same for every setting: efforts at common times, low-passed above all cut-offs that
are compared. Otherwise the setting that removes most would seem to be the best.

Friction follows a reversal late by pre-sliding (Dahl 1968), which a delay of the effort would mend
in part. So it is viscous and Coulomb friction at several times around that of the effort.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import lapack

from lip_id_ros.arrays import Array
from lip_id_ros.identification.statistics import contiguous_blocks
from lip_id_ros.preprocessing.pipeline import smooth
from lip_id_ros.preprocessing.segment import Segment
from lip_id_ros.preprocessing.smoothing import edge_length, grid_size, low_pass, uniform_times
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.settings import PreprocessingSettings

BLOCKS = 8
MOST_RAW = 60_000
"""Raw samples that are looked at; of more, as many pieces as there are blocks."""

MOST_JUDGED = 2000
"""Samples that links are fitted to."""

REFERENCE = 1.5
"""The low-pass of the efforts to predict, in highest cut-offs."""

SIGN_WIDTH = 0.05
"""Width of the smooth sign, as a share of each joint's root mean square velocity."""

LAGS_S = (-0.03, 0.0, 0.03, 0.06, 0.1)
"""How long before an effort the velocities of its friction were."""

PER_JOINT = 2 * len(LAGS_S) + 1
"""Columns of friction: viscous and Coulomb at every lag, and an offset."""

NOISE_ROUNDS = 2
INITIAL_NOISE, LEAST_NOISE = 0.05, 1e-4
"""Noise of the first fit, and least noise, as shares of each effort's standard deviation."""


def uniform_segments(
    segments: Sequence[Segment], settings: PreprocessingSettings, lowest_hz: float, reach_s: float
) -> list[tuple[Segment, int]]:
    """
    Bring segments of recordings, or some pieces of long ones, to uniform times.

    Each comes with how many samples at both ends are not compared, where the lowest cut-off
    invents a continuation, or motions are looked at from `reach_s` away.
    """
    found = []
    total = sum(segment.n_samples for segment in segments)
    for segment in segments:
        rate = segment.rate_hz
        edge = edge_length(rate, lowest_hz, settings.edge_periods, reach_s)
        for piece in _pieces(segment, total):
            if grid_size(piece.t, rate) > 2 * edge:
                found.append((piece.uniform(uniform_times(piece.t, rate)), edge))
        segment.release()
    return found


def _pieces(segment: Segment, total: int) -> Iterator[Segment]:
    """Yield pieces of a segment that is one of several with so many samples in total."""
    if total <= MOST_RAW:
        yield segment
        return
    count = max(1, round(BLOCKS * segment.n_samples / total))
    length = int(MOST_RAW / total * segment.n_samples / count)
    for start in np.linspace(0, segment.n_samples - length, count).astype(int).tolist():
        if length > 1:
            yield segment.rows(slice(start, start + length))


class LeftOutTorques:
    """
    Errors of left-out efforts, for settings of preprocessing and delays of efforts.

    `segments`: of `uniform_segments`.
    `highest_hz`: the highest cut-off that is compared.
    `chain`: where the joints are.
    `link_std`, shape (n, 11): prior standard deviations of link parameters.
    `usual`: with which widths of signs, sizes of friction and the noise are found.
    """

    def __init__(
        self,
        segments: Sequence[tuple[Segment, int]],
        highest_hz: float,
        chain: Chain,
        link_std: Array,
        usual: PreprocessingSettings,
    ) -> None:
        self._segments, self._chain = [segment for segment, _ in segments], chain
        self._link_std = link_std.ravel()
        inner_s = sum((each.n_samples - 2 * edge) / each.rate_hz for each, edge in segments)
        step = inner_s / MOST_JUDGED
        self._rows = [
            np.arange(edge, each.n_samples - edge, max(1, round(step * each.rate_hz)))
            for each, edge in segments
        ]
        number = contiguous_blocks(sum(rows.size for rows in self._rows), BLOCKS)
        self._blocks = [np.flatnonzero(number == k) for k in range(int(number[-1]) + 1)]
        self._target = self._chosen([target(each, highest_hz) for each in self._segments])
        self._size = _positive(self._target.std(axis=0))
        motion = self.smoothed(usual)
        self._speed = _positive(np.sqrt(np.mean(motion.state(0.0)[1] ** 2, axis=0)))
        self.noise_std = INITIAL_NOISE * self._size
        self.estimate_noise(self.grams(motion))

    @property
    def n_samples(self) -> int:
        """Number of samples that are compared."""
        return len(self._target)

    def estimate_noise(self, grams: Array) -> None:
        """Take the noise, by which joints are weighted, from left-out errors."""
        for _ in range(NOISE_ROUNDS):
            errors = np.sqrt(self.squares(grams).mean(axis=0))
            self.noise_std = np.maximum(errors, LEAST_NOISE * self._size)

    def smoothed(self, settings: PreprocessingSettings) -> Smoothed:
        """Return motions and efforts as settings make them."""
        splines, efforts = [], []
        for each in self._segments:
            *state, effort = smooth(each, settings)
            splines.append(CubicSpline(each.t, np.concatenate(state, axis=1)))
            efforts.append(effort)
        times = [each.t[rows] for each, rows in zip(self._segments, self._rows, strict=True)]
        return Smoothed(splines, times, self._chosen(efforts))

    def grams(self, smoothed: Smoothed, delay_s: float = 0.0) -> Array:
        """
        Return Gram matrices of every block and joint, for one delay of all efforts [s].

        Their columns are links, friction of the joint, efforts to learn from and to predict;
        shape (blocks, n, 11 n + 13, 11 n + 13).
        """
        q, dq, ddq = smoothed.state(delay_s)
        links = torque_regressor(self._chain, q, dq, ddq) * self._link_std
        usual = [each / self._speed for each in smoothed.velocities]
        sign = [np.tanh(each / SIGN_WIDTH) for each in usual]
        own = [self._size * each for each in (*usual, *sign, np.ones_like(q))]
        last = np.stack([*own, smoothed.effort, self._target], axis=2)
        rows = np.concatenate([links, last], axis=2).transpose(1, 0, 2)
        return np.stack(
            [rows[:, some].transpose(0, 2, 1) @ rows[:, some] for some in self._blocks]
        )

    def squares(self, grams: Array) -> Array:
        """Return mean squared errors of every left-out block and joint, (blocks, n)."""
        whole = grams.sum(axis=0)
        errors = np.empty(grams.shape[:2])
        for k, (gram, rows) in enumerate(zip(grams, self._blocks, strict=True)):
            parameters = self._parameters(whole - gram)
            vectors = np.concatenate([parameters, np.tile([0.0, -1.0], (len(parameters), 1))], 1)
            errors[k] = np.einsum('ja,jab,jb->j', vectors, gram, vectors) / rows.size
        return np.maximum(errors, LEAST_NOISE**4 * self._size**2)

    def percent(self, squares: Array) -> float:
        """Return errors as the geometric mean over joints of shares of the variance [%]."""
        shares = squares.mean(axis=0) / self._size**2
        return float(100.0 * np.exp(np.log(shares).mean()))

    def without_friction(self, gram: Array) -> tuple[Array, Array]:
        """
        Eliminate the friction of every joint from normal equations.

        `gram` has shape (n, 11 n + 13, 11 n + 13). Returns the equations of links and efforts to
        learn from, (n, 11 n + 1, 11 n + 1), in units of the noise, and friction for unit links and
        efforts, (n, 11, 11 n + 1).
        """
        p = self._link_std.size
        rest = np.append(np.arange(p), p + PER_JOINT)
        scaled = gram / self.noise_std[:, None, None] ** 2
        own, cross = scaled[:, p : p + PER_JOINT], scaled[:, p : p + PER_JOINT, rest]
        taken = np.linalg.solve(own[:, :, p : p + PER_JOINT] + np.eye(PER_JOINT), cross)
        reduced = scaled[:, rest[:, None], rest] - cross.transpose(0, 2, 1) @ taken
        return reduced, taken

    @staticmethod
    def least_squares(reduced: Array) -> tuple[Array, float]:
        """Return links, shape (11 n,), and squares in units of the noise, for sums over joints."""
        normal, right = reduced[:-1, :-1].copy(), reduced[:-1, -1]
        normal.flat[:: len(normal) + 1] += 1.0
        factor, _ = lapack.dpotrf(normal, lower=1)
        links, _ = lapack.dpotrs(factor, right, lower=1)
        return np.asarray(links), float(reduced[-1, -1] - right @ links)

    def _parameters(self, gram: Array) -> Array:
        """Return the parameters of every joint's columns, (n, 11 n + 11)."""
        reduced, taken = self.without_friction(gram)
        links, _ = self.least_squares(reduced.sum(axis=0))
        friction = taken[:, :, -1] - taken[:, :, :-1] @ links
        return np.concatenate([np.tile(links, (len(friction), 1)), friction], axis=1)

    def _chosen(self, values: Sequence[Array]) -> Array:
        return np.concatenate([v[rows] for v, rows in zip(values, self._rows, strict=True)])


class Smoothed:
    """
    Motions as functions of time, and efforts to learn from.

    Splines are of positions, velocities and accelerations of every segment, times those of its
    efforts [s]; these are of all segments, shape (N, n).
    """

    def __init__(
        self, splines: Sequence[CubicSpline], times: Sequence[Array], effort: Array
    ) -> None:
        self._splines, self._times, self.effort = splines, times, effort

    @cached_property
    def velocities(self) -> list[Array]:
        """Velocities at the lags of friction, shape (N, n) each."""
        return [self.state(lag)[1] for lag in LAGS_S]

    def state(self, delay_s: float) -> tuple[Array, Array, Array]:
        """Return q, dq and ddq some time earlier, shape (N, n) each."""
        values = [
            spline(times - delay_s)
            for spline, times in zip(self._splines, self._times, strict=True)
        ]
        q, dq, ddq = (
            np.ascontiguousarray(each) for each in np.split(np.concatenate(values), 3, axis=1)
        )
        return q, dq, ddq


def target(segment: Segment, highest_hz: float) -> Array:
    """Return the efforts that settings are compared by, shape (N, n)."""
    return low_pass(segment.effort, segment.rate_hz, REFERENCE * highest_hz)


def _positive(values: Array) -> Array:
    return np.where(values > 0.0, values, 1.0)
