"""Posterior means of the processes of a residual_gp, compiled."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.model.residual_gp import (
    kinds_of,
    ResidualGP,
    set_correlations,
    set_inputs,
    SIGN_WIDTH,
)
from lip_id_ros.model.threads import in_threads
from lip_id_ros.numba_jit import jit


class ResidualGPMean:
    """
    Torques of a residual GP.

    Samples without weights are left out. Processes with the same length scales share the
    correlations with their samples.
    """

    def __init__(self, residual_gp: ResidualGP) -> None:
        inputs, sizes = residual_gp.inputs, []
        different, kinds = kinds_of(residual_gp.lengths, residual_gp.joints)
        floats = [inputs.centre, 1.0 / inputs.scale, 1.0 / inputs.sign_width]
        floats.append(residual_gp.friction.ravel())
        for number, lengths in enumerate(different):
            weights = residual_gp.alpha[:, kinds == number]
            rows = weights.any(axis=1)
            x = residual_gp.x[rows] / lengths
            floats += [1.0 / lengths, x.T.ravel(), weights[rows].T.ravel()]
            sizes.append(int(rows.sum()))
        self.floats = np.concatenate(floats)
        self.integers = np.concatenate([inputs.revolute, residual_gp.replaces, kinds, sizes])

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the posterior mean at joint states of shape (N, n), same shape [N m or N]."""
        out = np.zeros(q.shape)
        self.add_to(out, q, dq, ddq)
        return out

    def add_to(self, tau: Array, q: Array, dq: Array, ddq: Array) -> None:
        """
        Add to torques of links and friction, or replace them as the processes do.

        `tau`, shape (N, n): changed [N m or N]. `q`, `dq`, `ddq`, shape (N, n).
        """
        q, dq, ddq = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq))

        def evaluate(rows: slice) -> None:
            add_means(tau[rows], q[rows], dq[rows], ddq[rows], self.floats, self.integers)

        in_threads(evaluate, len(tau))


@jit
def add_means(
    tau: Array, q: Array, dq: Array, ddq: Array, floats: Array, integers: IntArray
) -> None:
    """
    Add the means of processes to the torques of links and friction at N joint states.

    `tau`, `q`, `dq`, `ddq`, shape (N, n): as for `ResidualGPMean.add_to`. `floats`: one after the
    other: centre and inverse scale of the inputs; of the joints, inverse widths of smooth signs,
    and rows of three coefficients of friction; of each kind of process, inverse length scales, its
    inputs of samples in length scales, transposed, and the weights of its joints, one joint after
    the other. `integers`: one after the other: of each joint, whether it is revolute, whether its
    process replaces its links, and the kind of its process, -1 for none; of each kind, the number
    of samples.
    """
    n = tau.shape[1]
    revolute, replaces, kinds = integers[:n], integers[n : 2 * n], integers[2 * n : 3 * n]
    sizes = integers[3 * n :]
    width = 3 * n + revolute.sum()
    centre, inverse_scale = floats[:width], floats[width : 2 * width]
    friction = floats[2 * width :]
    z, memory = np.empty(width), np.empty(sizes.max())
    for t in range(len(tau)):
        set_inputs(z, q[t], dq[t], ddq[t], revolute, centre, inverse_scale)
        for i in range(n):
            if replaces[i]:
                tau[t, i] = _friction(friction[n + 3 * i :], dq[t, i] * friction[i])
        start = 2 * width + 4 * n
        for kind in range(len(sizes)):
            m = sizes[kind]
            x = start + width
            start_of_weights = x + width * m
            correlations = memory[:m]
            set_correlations(correlations, z, floats[x:start_of_weights], floats[start:x])
            start = start_of_weights
            for i in range(n):
                if kinds[i] == kind:
                    tau[t, i] += _dot(floats[start : start + m], correlations)
                    start += m


@jit
def _friction(coefficients: Array, ratio: float) -> float:
    """Return the torque of `Inputs.friction` at a velocity in widths of the smooth sign."""
    sign, viscous, offset = coefficients[0], coefficients[1], coefficients[2]
    return float(sign * np.tanh(ratio) + viscous * SIGN_WIDTH * ratio + offset)


@jit
def _dot(a: Array, b: Array) -> float:
    total = 0.0
    for m in range(len(a)):
        total += a[m] * b[m]
    return total
