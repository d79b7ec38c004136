"""
Torques that links do not explain.

A Gaussian process per joint, beside links or instead. Squared-exponential in (cosines and sines
of) positions, velocities and accelerations with a length scale for each (Rasmussen and Williams
2006, section 5.1).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.numba_jit import in_threads, jit

FRICTION_VARIANCE = 10.0
"""Prior variance of viscous and Coulomb friction and offset, in variances of the torque."""

SIGN_WIDTH = 0.05
"""Of the smooth signs of friction, in root mean square velocities."""

FAR, DEGREE, SQUARINGS = 128.0, 13, 7
"""
Squared distance beyond which correlations are zero to rounding; degree of their polynomial, and
how often it is squared.
"""

CHECKS, SEED = 1000, 0
"""Number of inputs beside the samples at which short cuts are compared with all samples."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """Joint states as inputs of a covariance."""

    revolute: BoolArray  # (n,)
    centre: Array  # (d,), mean of the training samples
    scale: Array  # (d,), their standard deviation
    sign_width: Array  # (n,), of smooth signs [rad/s or m/s]

    @classmethod
    def of(cls, revolute: BoolArray, q: Array, dq: Array, ddq: Array) -> Inputs:
        """Return the inputs that have unit variance for training samples of shape (N, n)."""
        raw = _raw(revolute, q, dq, ddq)
        scale, speed = raw.std(axis=0), np.sqrt(np.mean(dq**2, axis=0))
        width = SIGN_WIDTH * np.where(speed > 0.0, speed, 1.0)
        return cls(revolute, raw.mean(axis=0), np.where(scale > 0.0, scale, 1.0), width)

    def __call__(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the inputs of joint states of shape (N, n), shape (N, d)."""
        return np.asarray((_raw(self.revolute, q, dq, ddq) - self.centre) / self.scale)

    def friction(self, dq: Array) -> Array:
        """Return smooth sign, velocity in root mean squares and one, shape (N, n, 3)."""
        ratio = dq / self.sign_width
        return np.stack([np.tanh(ratio), SIGN_WIDTH * ratio, np.ones_like(dq)], axis=2)

    def friction_at(self, x: Array) -> Array:
        """Return the same at inputs, shapes (M, d) and (M, n, 3)."""
        rates = slice(-2 * len(self.revolute), -len(self.revolute))
        return self.friction(x[:, rates] * self.scale[rates] + self.centre[rates])


def stored_inputs(x: Array) -> Array:
    """Round inputs, which are of the size of 1, to what a model file keeps: half precision."""
    return np.asarray(x, dtype=np.float16).astype(np.float64)


def stored_weights(alpha: Array) -> Array:
    """Round weights to what a model file keeps: single precision."""
    return np.asarray(alpha, dtype=np.float32).astype(np.float64)


@dataclass(frozen=True, eq=False)
class ResidualGP:
    """Gaussian processes of the torques of some joints."""

    inputs: Inputs
    x: Array  # (M, d), by `stored_inputs`
    lengths: Array  # (n, d), of the inputs; 0 without a process
    noise: Array  # (n,), variances in those of the process
    variance: Array  # (n,), of the process [(N m)^2 or N^2]
    left_out_std: Array  # (n,), of left-out blocks: noise [N m or N]
    replaces: BoolArray  # (n,), whether in place of links and friction
    alpha: Array  # (M, n), by `stored_weights`, few not 0 [N m or N]
    friction: Array  # (n, 3), by `Inputs.friction`; 0 beside links

    @property
    def joints(self) -> BoolArray:
        """Which joints have a process, shape (n,)."""
        return np.asarray(self.lengths.any(axis=1))

    def beside_links(self) -> ResidualGP | None:
        """Return the processes beside links, without those in their place; None without any."""
        beside = self.joints & ~self.replaces
        if not beside.any():
            return None
        return replace(
            self,
            lengths=beside[:, None] * self.lengths,
            replaces=np.zeros_like(self.replaces),
            alpha=beside * self.alpha,
            friction=beside[:, None] * self.friction,
        )


def correlation(x: Array, z: Array, lengths: Array) -> Array:
    """Return the correlations of inputs, shapes (M, d) and (L, d), shape (M, L)."""
    x, z = x / lengths, z / lengths
    squares = np.sum(x**2, axis=1)[:, None] + np.sum(z**2, axis=1) - 2.0 * x @ z.T
    return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0)))


def kinds_of(parameters: Array, joints: BoolArray) -> tuple[Array, IndexArray]:
    """
    Return the different parameters of processes, and which of them each joint has.

    `parameters` has shape (n, p); `joints`, shape (n,), are those that have a process. The results
    have shapes (K, p) and (n,); the latter is -1 for joints without a process.
    """
    different, kinds = np.unique(parameters[joints], axis=0, return_inverse=True)
    out = np.full(len(joints), -1)
    out[joints] = kinds.ravel()
    return different, out


def near_and_beyond(x: Array) -> Array:
    """Return inputs, shape (M, d), and some near to them, between them and beyond."""
    rng = np.random.default_rng(SEED)
    first, second = rng.integers(len(x), size=(2, CHECKS))
    # Most are near the first of the two, where the variance changes most.
    share = 2.0 * rng.uniform(-1.0, 1.0, (CHECKS, 1)) ** 3
    return np.concatenate([x, x[first] + share * (x[second] - x[first])])


def _raw(revolute: BoolArray, q: Array, dq: Array, ddq: Array) -> Array:
    angles = q[:, revolute]
    return np.concatenate([np.cos(angles), np.sin(angles), q[:, ~revolute], dq, ddq], axis=1)


@jit
def set_inputs(
    z: Array,
    q: Array,
    dq: Array,
    ddq: Array,
    revolute: IntArray,
    centre: Array,
    inverse_scale: Array,
) -> None:
    """Set z, shape (d,), to the `Inputs` of one state."""
    turning = 0
    for i in range(len(q)):
        if revolute[i]:
            turning += 1
    angle, other = 0, 2 * turning
    for i in range(len(q)):
        if revolute[i]:
            z[angle], z[turning + angle] = np.cos(q[i]), np.sin(q[i])
            angle += 1
        else:
            z[other] = q[i]
            other += 1
    for i in range(len(q)):
        z[other + i], z[other + len(q) + i] = dq[i], ddq[i]
    for k in range(len(z)):
        z[k] = (z[k] - centre[k]) * inverse_scale[k]


@jit
def set_correlations(out: Array, z: Array, x: Array, inverse_lengths: Array) -> None:
    """Set the correlations, (m,), of inputs, (d,), with others: (d, m) in length scales, flat."""
    count = len(out)
    out[:] = 0.0
    for k in range(len(z)):
        at, others = z[k] * inverse_lengths[k], x[k * count : (k + 1) * count]
        for m in range(len(others)):
            out[m] += (at - others[m]) ** 2
    for m in range(count):
        out[m] = _squared_exponential(out[m])


@jit
def _squared_exponential(square: float) -> float:
    """
    Return exp(-square / 2) to 1e-13 of itself, and 1e-28 far away.

    A Taylor polynomial of a small share of the exponent, which is squared again and again: in
    vector instructions, a fifth of the time of `np.exp`.
    """
    x = 0.5 * min(square, FAR) / 2.0**SQUARINGS
    value = 1.0
    for k in range(DEGREE):
        value = 1.0 - x * (1.0 / (DEGREE - k)) * value
    for _ in range(SQUARINGS):
        value *= value
    return value


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
