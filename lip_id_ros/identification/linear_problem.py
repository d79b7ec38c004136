"""Links and friction of an arm with given placements: which samples and blocks they explain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.kinematic_calibration import PlacementProblem
from lip_id_ros.identification.left_out import Gain
from lip_id_ros.identification.placement_search import Calibration
from lip_id_ros.identification.sample_selection import NORMAL_MEDIAN
from lip_id_ros.identification.statistics import contiguous_blocks
from lip_id_ros.linear_algebra import normal_solution

FREEDOM, ROUNDS = 2.0, 6
"""Degrees of freedom of Student's t, and rounds of the robust fit."""

LEAST_RATIO, LEAST_DEVIATIONS, LEAST_SPREAD = 3.0, 3.0, 0.2
"""
A candidate's residual over the median block's, and the logarithm of that in robust standard
deviations, which are at least so large.
"""

FOLDS, NOISE_ROUNDS = 6, 3
"""Contiguous parts of the time, and rounds in which the noise is estimated."""


@dataclass(frozen=True, eq=False)
class LinearProblem:
    """
    Torques that are linear in the parameters of links and friction, with placements given.

    Features and torque are in units of the calibration's noise, and in both are the weights.
    """

    features: Array  # (N, n, P), and of the parameters' prior deviations
    torque: Array  # (N, n)
    weights: Array  # (N, n), of squared residuals
    block: IndexArray  # (N,), from 0 to K - 1
    floor: Array  # (n,), least variance of residuals

    @classmethod
    def of(
        cls, search: ArmSearch, calibration: Calibration, rows: IndexArray, block: IndexArray
    ) -> LinearProblem:
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

    def solved(self) -> tuple[Array, Array]:
        """Return the parameters, and the standard deviations of the joints' residuals, (n,)."""
        columns = self.features.transpose(1, 2, 0)
        normal = columns @ columns.transpose(0, 2, 1)
        right = (columns @ self.torque.T[..., None])[..., 0]
        precision = np.ones(self.torque.shape[1])
        for _ in range(NOISE_ROUNDS):
            parameters = _solved(np.tensordot(precision, normal, axes=1), precision @ right)
            squares = np.mean((self.torque - self.features @ parameters) ** 2, axis=0)
            precision = 1.0 / np.maximum(squares, self.floor)
        return parameters, np.sqrt(1.0 / precision)

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
    return normal_solution(normal + np.eye(right.size), right)
