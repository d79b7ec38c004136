"""
Episodes in which something else moves the arm: a contact, or efforts that are not measured.

Least squares spreads the torques of a contact over links and friction, so that all other torques
are predicted worse. Blocks of time that a robust fit does not explain are candidates (Student's t
by iteratively reweighted least squares: Lange, Little and Taylor, JASA 1989). They are left out
where the others, predicted without their own part of the time, are predicted far better so
(docs/maths.md, section 13).

"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.kinematic_calibration import PlacementProblem
from lip_id_ros.identification.left_out import Gain
from lip_id_ros.identification.placement_search import Calibration
from lip_id_ros.identification.sample_selection import evenly, NORMAL_MEDIAN
from lip_id_ros.identification.statistics import contiguous_blocks

BLOCK_S, LEAST_PER_BLOCK, MOST_BLOCKS = 0.5, 8, 240
"""Length of a block, samples of one, and blocks; the larger length counts."""

LEAST_BLOCKS = 20
"""Blocks without which there is no rest to contradict."""

MOST_SAMPLES = 3000
"""Samples that are looked at, at even distances."""

FREEDOM, ROUNDS = 2.0, 6
"""Degrees of freedom of Student's t, and rounds of the robust fit."""

LEAST_RATIO, LEAST_DEVIATIONS, LEAST_SPREAD = 3.0, 3.0, 0.2
"""
A candidate's residual over the median block's, and the logarithm of that in robust standard
deviations, which are at least so large.
"""

MOST = 0.4
"""Share of the samples beyond which candidates are no exception."""

FOLDS, LEAST_GAIN, LEAST_ERRORS, NOISE_ROUNDS = 6, 1.0, 2.0, 3
"""
Contiguous parts of the time, the least decrease of the logarithms of left-out mean squares, summed
over joints, its least in standard errors, and rounds in which the noise is estimated.
"""

PASSES = 2


@dataclass(frozen=True)
class Episode:
    """
    A part of a recording that was left out.

    Attributes
    ----------
    recording : int
    start_s, end_s : float
        First and last time [s].
    joints : tuple of int
        Whose torques are not explained.

    """

    recording: int
    start_s: float
    end_s: float
    joints: tuple[int, ...]


def without_disturbances(
    search: ArmSearch, calibration: Calibration
) -> tuple[ArmSearch, Calibration, list[Episode]]:
    """
    Leave out the episodes that contradict the rest of the samples, and refine the placements.

    Parameters
    ----------
    search : ArmSearch
    calibration : Calibration

    Returns
    -------
    ArmSearch, Calibration
        Those given where there are no such episodes.
    list of Episode
        In the order of the samples.

    Raises
    ------
    FitError
        If the data are not finite in units of the noise.

    """
    episodes: list[Episode] = []
    for _ in range(PASSES):
        fitter, block = search.fitter, time_blocks(search.fitter.dataset)
        disturbed = disturbed_blocks(search, calibration, block)
        if not disturbed.any():
            break
        episodes += _episodes(fitter.dataset, block, disturbed)
        kept = np.flatnonzero(~disturbed.any(axis=1)[block])
        search = search.of(fitter.of(fitter.dataset.select(kept)))
        calibration = search.recalibrated(calibration)
    return search, calibration, sorted(episodes, key=lambda each: (each.recording, each.start_s))


def halves_agree(search: ArmSearch, calibration: Calibration) -> bool:
    """
    Return whether the first and the second half of the samples are of one arm.

    They are not where one is predicted far better without the other, as when a payload was
    attached about between them; nothing says which of them is meant.

    """
    count = search.fitter.dataset.n_samples
    rows = evenly(count, MOST_SAMPLES)
    if rows.size < LEAST_PER_BLOCK * LEAST_BLOCKS:
        return True
    problem = _LinearProblem.of(search, calibration, rows, np.zeros(rows.size, np.intp))
    is_late = rows >= count // 2
    gains = problem.gain(is_late), problem.gain(~is_late)
    return not any(gain.is_sure(LEAST_GAIN, LEAST_ERRORS) for gain in gains)


def time_blocks(dataset: Dataset) -> IndexArray:
    """Return the block of every sample, (N,): contiguous times of a segment, in their order."""
    new = np.diff(dataset.segment, prepend=dataset.segment[:1]) != 0
    steps = np.diff(dataset.t, prepend=dataset.t[:1])[~new]
    length = max(
        BLOCK_S, LEAST_PER_BLOCK * float(np.median(steps)), float(steps.sum()) / MOST_BLOCKS
    )
    part = np.cumsum(new)
    first = np.flatnonzero(new | (np.arange(new.size) == 0))
    number = np.floor((dataset.t - dataset.t[first][part]) / length)
    return np.cumsum(np.diff(number, prepend=0.0).astype(bool) | new)


def disturbed_blocks(search: ArmSearch, calibration: Calibration, block: IndexArray) -> BoolArray:
    """
    Mark the blocks that contradict the others, by the joints whose torques are not explained.

    Parameters
    ----------
    search : ArmSearch
    calibration : Calibration
    block : array, shape (N,)
        Of `time_blocks`.

    Returns
    -------
    bool array, shape (blocks, n)

    """
    rows = evenly(block.size, MOST_SAMPLES)
    judged, number = np.unique(block[rows], return_inverse=True)
    marks = np.zeros((int(block[-1]) + 1, search.fitter.dataset.n_joints), dtype=bool)
    if judged.size < LEAST_BLOCKS:
        return marks
    problem = _LinearProblem.of(search, calibration, rows, number)
    candidates = problem.candidates()
    out = candidates.any(axis=1)[number]
    if 0.0 < out.mean() <= MOST and problem.gain(out).is_sure(LEAST_GAIN, LEAST_ERRORS):
        marks[judged] = candidates
    return marks


@dataclass(frozen=True, eq=False)
class _LinearProblem:
    """
    Torques that are linear in the parameters of links and friction, with placements given.

    Attributes
    ----------
    features : array, shape (N, n, P)
        In units of the calibration's noise and of the parameters' deviations a priori.
    torque, weights : arrays, shape (N, n)
        Torque in these units, and weight of the squared residuals, which is in both.
    block : array, shape (N,)
        From 0 to K - 1.
    floor : array, shape (n,)
        Least variance of residuals.

    """

    features: Array
    torque: Array
    weights: Array
    block: IndexArray
    floor: Array

    @classmethod
    def of(
        cls, search: ArmSearch, calibration: Calibration, rows: IndexArray, block: IndexArray
    ) -> _LinearProblem:
        """Return the problem of some rows with the placements of a calibration."""
        samples = search.samples(search.fitter.dataset.select(rows))
        chain = calibration.placements.chain
        problem = PlacementProblem(samples, calibration.noise_std)
        features = problem.at(chain.rotations, chain.translations).features
        torque = samples.tau * np.sqrt(samples.weights) / calibration.noise_std
        shape = (*torque.shape, features.shape[1])
        floor = np.square(search.fitter.least_noise / calibration.noise_std)
        return cls(features.reshape(shape), torque, samples.weights, block, floor)

    def candidates(self) -> BoolArray:
        """Mark the blocks whose residuals of a robust fit are far larger than most, (K, n)."""
        scale, count = np.ones_like(self.torque), self._of_blocks(self.weights)
        for _ in range(ROUNDS):
            rows = (self.features * scale[..., None]).reshape(self.torque.size, -1)
            parameters = _solved(rows.T @ rows, rows.T @ (self.torque * scale).ravel())
            squares = self._of_blocks((self.torque - self.features @ parameters) ** 2) / count
            variance = np.maximum(np.median(squares, axis=0), self.floor)
            weights = (FREEDOM + 1.0) / (FREEDOM + squares / variance)
            scale = np.sqrt(np.minimum(weights, 1.0) / variance)[self.block]
        ratio = 0.5 * np.log(np.maximum(squares, self.floor) / variance)
        spread = np.median(np.abs(ratio), axis=0) / NORMAL_MEDIAN
        least = LEAST_DEVIATIONS * np.maximum(spread, LEAST_SPREAD)
        return np.asarray(ratio > np.maximum(least, np.log(LEAST_RATIO)))

    def gain(self, out: BoolArray) -> Gain:
        """Return how much better the other samples are predicted without some, (N,)."""
        fold = contiguous_blocks(out.size, FOLDS)
        kept, left = (self._normal_equations(fold, part) for part in (~out, out))
        both = kept[0] + left[0], kept[1] + left[1]
        residuals = (
            self._left_out(*both, fold, np.ones_like(out)),
            self._left_out(*kept, fold, ~out),
        )
        masks = [mask for k in range(FOLDS) if (mask := (fold == k) & ~out).any()]
        now, other = (
            np.array([np.sum(each[mask] ** 2, axis=0) for mask in masks]) + self.floor
            for each in residuals
        )
        return Gain.between([now], [other])

    def _normal_equations(self, fold: IndexArray, some: BoolArray) -> tuple[Array, Array]:
        """Return those of some samples by folds and joints, (F, n, P, P) and (F, n, P)."""
        masks = [some & (fold == k) for k in range(FOLDS)]
        joints = [self.features[mask].transpose(1, 2, 0) for mask in masks]
        torques = [self.torque[mask].T[..., None] for mask in masks]
        normal = [each @ each.transpose(0, 2, 1) for each in joints]
        right = [(each @ tau)[..., 0] for each, tau in zip(joints, torques, strict=True)]
        return np.array(normal), np.array(right)

    def _left_out(self, normal: Array, right: Array, fold: IndexArray, used: BoolArray) -> Array:
        """Return the residuals of all samples, each predicted without its fold, (N, n)."""
        residual, precision = np.empty_like(self.torque), np.ones(self.torque.shape[1])
        rest = normal.sum(axis=0) - normal, right.sum(axis=0) - right
        for _ in range(NOISE_ROUNDS):
            for k in range(FOLDS):
                parameters = _solved(
                    np.tensordot(precision, rest[0][k], axes=1), precision @ rest[1][k]
                )
                mask = fold == k
                residual[mask] = self.torque[mask] - self.features[mask] @ parameters
            squares = np.sum(residual[used] ** 2, axis=0) / np.sum(self.weights[used], axis=0)
            precision = 1.0 / np.maximum(squares, self.floor)
        return residual

    def _of_blocks(self, values: Array) -> Array:
        """Return the sums over blocks, shape (K, n)."""
        return np.column_stack([np.bincount(self.block, each) for each in values.T])


def _solved(normal: Array, right: Array) -> Array:
    """Return the parameters, which are standard normal a priori."""
    return np.asarray(cho_solve(cho_factor(normal + np.eye(right.size)), right))


def _episodes(dataset: Dataset, block: IndexArray, disturbed: BoolArray) -> Iterator[Episode]:
    """Yield runs of disturbed blocks of one recording."""
    rows = disturbed.any(axis=1)[block]
    begins = np.diff(rows, prepend=False) | (np.diff(dataset.segment, prepend=-1) != 0)
    for run in np.split(np.arange(block.size), np.flatnonzero(begins)[1:]):
        if rows[run[0]]:
            joints = np.flatnonzero(disturbed[np.unique(block[run])].any(axis=0))
            first, last = run[0], run[-1]
            yield Episode(
                int(dataset.recording[first]),
                float(dataset.t[first]),
                float(dataset.t[last]),
                tuple(joints.tolist()),
            )
