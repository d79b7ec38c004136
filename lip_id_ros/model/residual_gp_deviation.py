"""
Standard deviations of a residual GP from few of its samples, compiled (maths.md, section 13).

Inducing points (Quinonero-Candela and Rasmussen 2005) by pivoted Cholesky factorisation, as many
as keep deviations close to the exact ones. Friction in place of links has coefficients of its own
(Rasmussen and Williams 2006, equation 2.42).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_solve, cholesky, qr, solve_triangular
from scipy.linalg.lapack import dpstrf

from lip_id_ros.arrays import Array, IndexArray, IntArray
from lip_id_ros.model.residual_gp import (
    correlation,
    FRICTION_VARIANCE,
    kinds_of,
    near_and_beyond,
    ResidualGP,
    set_correlations,
    set_inputs,
    SIGN_WIDTH,
)
from lip_id_ros.numba_jit import in_threads, jit

MOST_LARGER, MOST_SMALLER = 0.02, 0.003
"""By how much a deviation may exceed or fall short of the exact one at the checks, as shares."""

STEP = 16
"""Samples that are added at a time."""

LEAST_SHARE = 1e-6
"""Of its posterior variance: a value that varies less than this, given others, adds nothing."""

LEAST_VARIANCE = 1e-12
"""In variances of the process: posterior variances below this are rounding errors."""


class ResidualGPDeviation:
    """
    Posterior standard deviations of the torques of a residual GP.

    Construction finds the samples that are needed, once for all joints whose processes have the
    same length scales and noise; nothing is checked after that.
    """

    def __init__(self, residual_gp: ResidualGP) -> None:
        inputs, sizes = residual_gp.inputs, []
        parameters = np.column_stack([residual_gp.lengths, residual_gp.noise])
        different, processes = kinds_of(parameters, residual_gp.joints)
        floats = [inputs.centre, 1.0 / inputs.scale, np.sqrt(residual_gp.variance)]
        floats.append(1.0 / inputs.sign_width)
        friction = inputs.friction_at(residual_gp.x)
        for number, each in enumerate(different):
            lengths, own = each[:-1], residual_gp.replaces & (processes == number)
            x, root, rows = compacted(residual_gp.x, lengths, float(each[-1]), friction[:, own])
            floats += [1.0 / lengths, (x / lengths).T.ravel(), root[np.triu_indices_from(root)]]
            floats.append(rows.ravel())
            sizes.append(len(x))
        # A call from Python takes longer for every array that is passed.
        self._floats = np.concatenate(floats)
        self._integers = np.concatenate([inputs.revolute, residual_gp.replaces, processes, sizes])

    def add_to(self, std: Array, q: Array, dq: Array, ddq: Array) -> None:
        """
        Add variances to those of links and friction; they replace them as the processes do.

        `std`, shape (N, n): deviations of the torques of links and friction; changed to those of
        all [N m or N]. `q`, `dq`, `ddq`, shape (N, n).
        """
        q, dq, ddq = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq))

        def evaluate(rows: slice) -> None:
            add_deviations(std[rows], q[rows], dq[rows], ddq[rows], self._floats, self._integers)

        in_threads(evaluate, len(std))


def compacted(
    x: Array, lengths: Array, noise: float, friction: Array
) -> tuple[Array, Array, Array]:
    """
    Return what the deviations of a process need.

    `x`, shape (M, d): inputs of the samples.
    `lengths`, shape (d,).
    `noise`: variance of the noise in those of the process.
    `friction`, shape (M, J, 3): features of friction of the J joints whose links the process
    replaces.
    Returns some of the inputs, (m, d); an upper triangular T, (m, m): the variance at an input is
    1 - |T k|^2 in those of the process, where k are its correlations with these inputs; and E,
    (J, 3, 3 + m): friction adds the variance |E [f, k]|^2, where f are its features.
    """
    gram = correlation(x, x, lengths)
    noisy = cholesky(gram + noise * np.eye(len(x)), lower=True)
    inverse = solve_triangular(noisy, np.eye(len(x)), lower=True)
    variance = noise - noise**2 * np.sum(inverse**2, axis=0)
    order, upper = _pivoted(gram, np.maximum(variance, LEAST_VARIANCE))
    rank = len(upper)
    factor = qr(inverse[:, order] @ upper.T, mode='r')[0][:rank]
    checks = near_and_beyond(x)
    cross = correlation(x, checks, lengths)
    exact = np.maximum(1.0 - np.sum((inverse @ cross) ** 2, axis=0), LEAST_VARIANCE)
    values = solve_triangular(upper[:, :rank], cross[order[:rank]], trans='T')
    spread, size = np.zeros((rank, len(checks))), 0
    while size < rank:
        more = slice(size, min(size + STEP, rank))
        size = more.stop
        spread[:size] += factor[:size, more] @ values[more]
        ratio = np.sqrt(np.maximum(1.0 - np.sum(spread[:size] ** 2, axis=0), 0.0) / exact)
        if ratio.max() < 1.0 + MOST_LARGER and ratio.min() > 1.0 - MOST_SMALLER:
            break
    by_value = solve_triangular(upper[:size, :size], factor[:size, :size].T)
    weights = np.einsum('ab,ac,cjk->bjk', inverse, inverse, friction, optimize=True)
    means = np.einsum('am,mjk->ajk', gram[order[:size]], weights)
    values = cho_solve((upper[:size, :size], False), means.reshape(size, -1)).reshape(means.shape)
    rows = np.zeros((friction.shape[1], 3, 3 + size))
    for joint, out in enumerate(rows):
        own = friction[:, joint]
        precision = np.eye(3) / FRICTION_VARIANCE + own.T @ weights[:, joint]
        away = np.column_stack([np.eye(3), -values[:, joint].T])
        out[:] = solve_triangular(cholesky(precision, lower=True), away, lower=True)
    return x[order[:size]], qr(by_value.T, mode='r')[0], rows


def _pivoted(gram: Array, variance: Array) -> tuple[IndexArray, Array]:
    """
    Return an order of samples, (M,), and U, (r, M): the Gram matrix is U^T U in this order.

    The next sample has the largest variance given those before it, relative to its posterior one.
    """
    std = np.sqrt(variance)
    upper, pivots, rank, _ = dpstrf(gram / np.outer(std, std), tol=LEAST_SHARE)
    order = pivots - 1
    return order, np.triu(upper[:rank]) * std[order]


@jit
def add_deviations(
    out: Array, q: Array, dq: Array, ddq: Array, floats: Array, integers: IntArray
) -> None:
    """
    Add the variances of processes to those of links and friction at N joint states.

    `out`, `q`, `dq`, `ddq`, shape (N, n): as for `ResidualGPDeviation.add_to`. `floats`: one after
    the other: centre and inverse scale of the inputs; prior standard deviations of the joints;
    inverse widths of their smooth signs; of each process, inverse length scales, its inputs of
    samples in length scales, transposed, the rows of the upper triangle of its root, and E of the
    joints whose links it replaces. `integers`: one after the other: of each joint, whether it is
    revolute, whether its process replaces its links, and the number of its process, -1 for none;
    of each process, the number m of its samples.
    """
    n = out.shape[1]
    revolute, replaces, processes = integers[:n], integers[n : 2 * n], integers[2 * n : 3 * n]
    sizes = integers[3 * n :]
    width = 3 * n + revolute.sum()
    centre, inverse_scale = floats[:width], floats[width : 2 * width]
    std = floats[2 * width : 2 * width + n]
    inverse_sign_width = floats[2 * width + n : 2 * width + 2 * n]
    z, memory, features = np.empty(width), np.empty(sizes.max()), np.ones(3)
    for t in range(len(out)):
        set_inputs(z, q[t], dq[t], ddq[t], revolute, centre, inverse_scale)
        start = 2 * width + 2 * n
        for p in range(len(sizes)):
            m = sizes[p]
            x = start + width
            root = x + width * m
            start_of_process, start = start, root + m * (m + 1) // 2
            set_correlations(memory[:m], z, floats[x:root], floats[start_of_process:x])
            known = squared_norm(floats[root:start], memory[:m])
            share = 0.0 if known > 1.0 else 1.0 - known
            for i in range(n):
                if processes[i] != p:
                    continue
                if replaces[i]:
                    ratio = dq[t, i] * inverse_sign_width[i]
                    features[0], features[1] = np.tanh(ratio), SIGN_WIDTH * ratio
                    end = start + 3 * (3 + m)
                    own = squared_rows(floats[start:end], features, memory[:m])
                    out[t, i], start = std[i] * np.sqrt(share + own), end
                else:
                    out[t, i] = np.hypot(out[t, i], std[i] * np.sqrt(share))


@jit
def squared_rows(rows: Array, features: Array, correlations: Array) -> float:
    """Return the squared norm of three rows times features and correlations."""
    norm, place = 0.0, 0
    for _ in range(3):
        total = 0.0
        for part in (features, correlations):
            for value in part:
                total += rows[place] * value
                place += 1
        norm += total * total
    return norm


@jit
def squared_norm(rows: Array, vector: Array) -> float:
    """Return the squared norm of an upper triangle, row by row, times a vector."""
    norm, start = 0.0, 0
    for c in range(len(vector)):
        rest = vector[c:]
        row = rows[start : start + len(rest)]
        total = 0.0
        for m in range(len(row)):
            total += row[m] * rest[m]
        norm += total * total
        start += len(rest)
    return norm
