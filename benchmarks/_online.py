"""Rivals that learn torques sample by sample: recursive least squares with features of a state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg.blas import dger
from scipy.optimize import minimize

from benchmarks._drives import RandomArm, WIDTH
from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body.regressor import torque_regressor

FREQUENCIES, ITERATIONS, LEAST_NOISE = 200, 30, 1e-3
"""Of the sparse spectrum, steps of its likelihood, and least noise in deviations of a torque."""

WIDE, LEAST_SIZE = 1e6, 1e-8
"""
Variance of the coefficients of the true arm before the first sample, in that of a usual torque,
and least size of what they change.
"""


def least_squares(features: Array, torque: Array, variance: Array, fading: float) -> Array:
    """
    Predict the torque of each of N samples, then learn from it.

    Recursive least squares (Astrom and Wittenmark, Adaptive Control, 2.2) with a forgetting factor
    whose covariance returns to its beginning where nothing is seen.

    `features`, shape (N, p), are in deviations of the noise, and so is the `torque`, shape (N,).
    `variance`, shape (p,): of the weights at first. `fading`: what is forgotten in a step.

    """
    weights, found = np.zeros(len(variance)), np.empty(len(torque))
    covariance = np.asfortranarray(np.diag(variance))
    for t, (row, target) in enumerate(zip(features, torque, strict=True)):
        found[t] = row @ weights
        spread = covariance @ row
        weights += spread * ((target - found[t]) / (1.0 + row @ spread))
        covariance = dger(-1.0 / (1.0 + row @ spread), spread, spread, a=covariance, overwrite_a=1)
        if fading > 0.0:
            covariance *= 1.0 - fading
            covariance.flat[:: len(variance) + 1] += fading * variance
    return found


class Spectrum(NamedTuple):
    """
    A Gaussian process of squared exponential kernel as weights of random sines.

    Sparse spectrum regression with incremental updates (Gijsberts and Metta, Neural Networks
    2013). `widths`, shape (d,): length scales of the inputs; `size`, `noise`: deviations of the
    torque.

    """

    widths: Array
    size: float
    noise: float

    def features(self, inputs: Array, drawn: Array) -> Array:
        """Return features (N, 2 D) of inputs (N, d) for frequencies (D, d) that were drawn."""
        angle = inputs @ (drawn / self.widths).T
        waves = np.hstack([np.cos(angle), np.sin(angle)])
        return np.asarray(waves * (self.size / np.sqrt(len(drawn))))

    @classmethod
    def fitted(cls, inputs: Array, torque: Array, drawn: Array) -> Spectrum:
        """Maximise the likelihood of torques (N,)."""
        start = np.concatenate([np.full(inputs.shape[1], np.log(3.0)), [0.0, np.log(0.1)]])
        bounds = [(-2.0, 5.0)] * inputs.shape[1] + [(-3.0, 3.0), (np.log(LEAST_NOISE), 0.0)]
        options = {'maxiter': ITERATIONS}
        best = minimize(
            lambda x: cls._of(x)._cost(inputs, torque, drawn),
            start,
            bounds=bounds,
            options=options,
        )
        return cls._of(best.x)

    @classmethod
    def _of(cls, logarithms: Array) -> Spectrum:
        values = np.exp(logarithms)
        return cls(values[:-2], float(values[-2]), float(values[-1]))

    def _cost(self, inputs: Array, torque: Array, drawn: Array) -> float:
        """Return the negative logarithm of the likelihood."""
        rows = self.features(inputs, drawn) / self.noise
        root = np.linalg.cholesky(rows.T @ rows + np.eye(rows.shape[1]))
        half = np.linalg.solve(root, rows.T @ torque / self.noise)
        left = (torque / self.noise) @ (torque / self.noise) - half @ half
        return float(
            0.5 * left + np.log(np.diagonal(root)).sum() + len(torque) * np.log(self.noise)
        )


def sparse_spectrum(
    states: tuple[Array, Array, Array], tau: Array, first: int, fadings: Sequence[float]
) -> list[Array]:
    """
    Predict torques (N, n) by Gaussian processes, one after the other, and learn from each.

    `states`: q, dq, ddq, each (N, n). `first`: how many samples choose the hyperparameters.
    `fadings`: what is forgotten in a step, for each of the results.

    """
    inputs, rng = np.hstack(states), np.random.default_rng(0)
    inputs = (inputs - inputs[:first].mean(axis=0)) / inputs[:first].std(axis=0)
    drawn = rng.standard_normal((FREQUENCIES, inputs.shape[1]))
    found = [np.empty_like(tau) for _ in fadings]
    for j, torque in enumerate(tau.T):
        mean, std = torque[:first].mean(), torque[:first].std()
        scaled = (torque - mean) / std
        own = Spectrum.fitted(inputs[:first], scaled[:first], drawn[: FREQUENCIES // 2])
        rows = own.features(inputs, drawn) / own.noise
        for out, fading in zip(found, fadings, strict=True):
            predicted = least_squares(rows, scaled / own.noise, np.ones(rows.shape[1]), fading)
            out[:, j] = mean + std * own.noise * predicted
    return found


def true_regressor(
    arm: RandomArm, states: tuple[Array, Array, Array], tau: Array, noise: Array, fading: float
) -> Array:
    """
    Predict torques (N, n) of an arm whose kinematics and friction terms are known.

    `noise`, shape (n,): deviations of the measured torques [N m].

    """
    _, dq, _ = states
    n, links = tau.shape[1], torque_regressor(arm.chain, *states)
    friction = np.zeros((*tau.shape, 3 * n))
    for j in range(n):
        own = np.stack([dq[:, j], np.tanh(dq[:, j] / WIDTH), np.ones(len(dq))], axis=1)
        friction[:, j, 3 * j : 3 * j + 3] = own
    rows = np.concatenate([links, friction], axis=2) / noise[:, None]
    _, sizes, axes = np.linalg.svd(rows.reshape(-1, rows.shape[2]), full_matrices=False)
    kept = sizes > LEAST_SIZE * sizes[0]  # others change no torque
    rows = rows @ (axes[kept].T / sizes[kept])
    information, target = np.eye(rows.shape[2]) / (WIDE * len(tau)), np.zeros(rows.shape[2])
    found = np.empty_like(tau)
    for t, (own, torque) in enumerate(zip(rows, tau / noise, strict=True)):
        found[t] = own @ np.linalg.solve(information, target)
        information = (1.0 - fading) * information + own.T @ own
        target = (1.0 - fading) * target + own.T @ torque
    return found * noise
