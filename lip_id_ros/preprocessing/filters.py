"""
Butterworth filters and polynomial derivatives of uniform samples.

The same as in scipy.signal, whose import takes as long as all else that reads a short recording.
A recursive filter is linear in its state and its input, so that blocks of samples are products of
matrices (Burrus, Block realization of digital filters, IEEE Trans. Audio Electroacoust., 1972).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from lip_id_ros.arrays import Array

SETTLED = np.array([1.0, 0.0, 1.0, 0.0])
"""State that inputs of 1 lead to."""

BLOCK = 64
"""Samples that are products of matrices."""


@dataclass(frozen=True, eq=False)
class BlockFilter:
    """A filter of s states by blocks of L samples: y = O s + T x, and then s becomes A s + K x."""

    of_state: Array  # (L, s), O
    of_input: Array  # (L, L), T
    next_of_state: Array  # (s, s), A
    next_of_input: Array  # (s, L), K

    @classmethod
    def butterworth(cls, cutoff: float) -> BlockFilter:
        """Return the low-pass of fourth order with a cut-off in shares of the rate."""
        transition, entering, leaving, through = _low_pass(cutoff)
        powers = [np.eye(len(transition))]
        for _ in range(BLOCK):
            powers.append(powers[-1] @ transition)
        response = np.array([through, *(leaving @ power @ entering for power in powers[:-2])])
        lag = np.subtract.outer(np.arange(BLOCK), np.arange(BLOCK))
        return cls(
            np.array([leaving @ power for power in powers[:-1]]),
            np.where(lag >= 0, response[lag], 0.0),
            powers[-1],
            np.column_stack([power @ entering for power in powers[-2::-1]]),
        )

    def filtered(self, values: Array) -> Array:
        """Filter signals, shape (m, N), as if each had had its first value for ever."""
        signals, count = values.shape
        blocks = -(-count // BLOCK)
        rows = np.zeros((signals, blocks * BLOCK))
        rows[:, :count] = values
        rows = rows.reshape(signals * blocks, BLOCK)
        states = (rows @ self.next_of_input.T).reshape(signals, blocks, -1)
        begin = np.empty_like(states)
        begin[:, 0], begin[:, 1:] = values[:, :1] * SETTLED, states[:, :-1]
        _accumulate(begin, self.next_of_state)
        out = rows @ self.of_input.T
        out += begin.reshape(signals * blocks, -1) @ self.of_state.T
        return out.reshape(signals, -1)[:, :count]


def _low_pass(cutoff: float) -> tuple[Array, Array, Array, float]:
    """
    Return A, b, c and d of a Butterworth low-pass of fourth order: s' = A s + b x, y = c s + d x.

    The states are values and slopes of two low-passes of second order in a row, by the bilinear
    transform: close to rounding however low the cut-off is, which coefficients of z are not.
    """
    by_state = np.array([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1], [1, 0, -1, 0]], np.float64)
    by_state[1, 1], by_state[3, 3] = -2.0 * np.sin(np.pi / 8.0), -2.0 * np.cos(np.pi / 8.0)
    half = np.tan(np.pi * cutoff)
    inverse = np.linalg.inv(np.eye(4) - half * by_state)
    entering = 2.0 * half * inverse[:, 1]
    return inverse @ (np.eye(4) + half * by_state), entering, inverse[2], 0.5 * entering[2]


def _accumulate(states: Array, transition: Array) -> None:
    """Add to each of the states (m, k, s) what those before it lead to, in log k steps."""
    step = 1
    while step < states.shape[1]:
        states[:, step:] += states[:, :-step] @ transition.T
        transition, step = transition @ transition, 2 * step


@cache
def _butterworth(cutoff: float) -> BlockFilter:
    return BlockFilter.butterworth(cutoff)


def zero_phase_butterworth(values: Array, cutoff: float, padding: int) -> Array:
    """
    Filter forwards and backwards, by a Butterworth low-pass of fourth order each time.

    Samples (N, ...) continue by their reflections in the first and the last one, so many, and then
    remain. The cut-off is a share of the rate.
    """
    rows = values.reshape(len(values), -1).T
    before = 2.0 * rows[:, :1] - rows[:, padding:0:-1]
    after = 2.0 * rows[:, -1:] - rows[:, -2 : -padding - 2 : -1]
    whole, low_pass = np.hstack([before, rows, after]), _butterworth(cutoff)
    forwards = low_pass.filtered(whole)
    both = low_pass.filtered(forwards[:, ::-1])[:, ::-1]
    out = both[:, padding : padding + len(values)].T
    return np.ascontiguousarray(out).reshape(values.shape)


def polynomial_derivative(values: Array, step: float, points: int, degree: int) -> Array:
    """
    Return the slopes of polynomials fitted to so many neighbours (Savitzky and Golay 1964).

    At the ends those of the first and the last polynomial.
    """
    half = points // 2
    place = np.arange(-half, half + 1.0)
    fit = np.linalg.pinv(np.vander(place, degree + 1, increasing=True))
    slopes = _slopes(place, degree) @ fit / step
    count = len(values) - points + 1
    out = np.empty_like(values)
    out[half : half + count] = sum(
        slopes[half, k] * values[k : k + count] for k in range(points) if slopes[half, k] != 0.0
    )
    out[:half] = np.tensordot(slopes[:half], values[:points], axes=1)
    out[-half:] = np.tensordot(slopes[-half:], values[-points:], axes=1)
    return out


def _slopes(place: Array, degree: int) -> Array:
    """Return the slopes of the powers up to a degree, shape (m, degree + 1)."""
    power = np.arange(degree + 1)
    return np.asarray(power * np.power(place[:, None], np.maximum(power - 1, 0)))
