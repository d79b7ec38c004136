"""
Torques that links do not explain: a Gaussian process per joint, beside the links or instead.

Squared-exponential covariance in cosines and sines of revolute positions, prismatic positions,
velocities and accelerations with one length scale for each of them
(Rasmussen and Williams 2006, section 5.1).

"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.numba_jit import jit

FRICTION_VARIANCE = 10.0
"""Prior variance of viscous and Coulomb friction and offset, in variances of the torque."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """
    Joint states as inputs of a covariance.

    Attributes
    ----------
    revolute : bool array, shape (n,)
    centre, scale : arrays, shape (d,)
        Mean and standard deviation of the training samples.
    sign_width : array, shape (n,)
        Of the smooth signs of friction [rad/s or m/s].

    """

    revolute: BoolArray
    centre: Array
    scale: Array
    sign_width: Array

    @classmethod
    def of(cls, revolute: BoolArray, q: Array, dq: Array, ddq: Array) -> Inputs:
        """Return the inputs that have unit variance for training samples of shape (N, n)."""
        raw = _raw(revolute, q, dq, ddq)
        scale, speed = raw.std(axis=0), np.sqrt(np.mean(dq**2, axis=0))
        width = 0.05 * np.where(speed > 0.0, speed, 1.0)
        return cls(revolute, raw.mean(axis=0), np.where(scale > 0.0, scale, 1.0), width)

    def __call__(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the inputs of joint states of shape (N, n), shape (N, d)."""
        return np.asarray((_raw(self.revolute, q, dq, ddq) - self.centre) / self.scale)

    def friction(self, dq: Array) -> Array:
        """Return smooth sign, velocity in root mean squares and one, shape (N, n, 3)."""
        ratio = dq / self.sign_width
        return np.stack([np.tanh(ratio), 0.05 * ratio, np.ones_like(dq)], axis=2)


def stored_inputs(x: Array) -> Array:
    """Round inputs, which are of the size of 1, to what a model file keeps: half precision."""
    return np.asarray(x, dtype=np.float16).astype(np.float64)


def stored_weights(alpha: Array) -> Array:
    """Round weights to what a model file keeps: single precision."""
    return np.asarray(alpha, dtype=np.float32).astype(np.float64)


@dataclass(frozen=True, eq=False)
class Remainder:
    """
    Gaussian processes of the torques of some joints.

    Attributes
    ----------
    inputs : Inputs
    x : array, shape (M, d)
        Of the training samples, by `stored_inputs`.
    lengths : array, shape (n, d)
        Length scales of the inputs; 0 for joints without a process.
    noise, variance : arrays, shape (n,)
        Variances of the noise in those of the process, and these [(N m)^2 or N^2].
    left_out_std : array, shape (n,)
        Root mean square errors of left-out blocks of time: the noise of measurements [N m or N].
    replaces : bool array, shape (n,)
        Joints whose process takes the place of links and friction.
    alpha : array, shape (M, n)
        Weights of the posterior mean, by `stored_weights` [N m or N].
    friction : array, shape (n, 3)
        Coefficients of `Inputs.friction` [N m or N]; zero beside links.

    """

    inputs: Inputs
    x: Array
    lengths: Array
    noise: Array
    variance: Array
    left_out_std: Array
    replaces: BoolArray
    alpha: Array
    friction: Array

    @property
    def joints(self) -> BoolArray:
        """Which joints have a process, shape (n,)."""
        return np.asarray(self.lengths.any(axis=1))

    def beside_links(self) -> Remainder | None:
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

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the posterior mean at joint states of shape (N, n), same shape [N m or N]."""
        z = self.inputs(q, dq, ddq)
        out: Array = np.einsum('tik,ik->ti', self.inputs.friction(dq), self.friction)
        add_means(out, z, self.x, self.lengths, self.alpha)
        return out


def correlation(x: Array, z: Array, lengths: Array) -> Array:
    """Return the correlations of inputs, shapes (M, d) and (L, d), shape (M, L)."""
    x, z = x / lengths, z / lengths
    squares = np.sum(x**2, axis=1)[:, None] + np.sum(z**2, axis=1) - 2.0 * x @ z.T
    return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0)))


@jit
def add_means(out: Array, z: Array, x: Array, lengths: Array, alpha: Array) -> None:
    """Add correlations of (L, d) and (M, d) times weights (M, n), joint by joint, to (L, n)."""
    for i in range(len(lengths)):
        if lengths[i, 0] == 0.0:
            continue
        inverse = 1.0 / lengths[i]
        for t in range(len(z)):
            mean = 0.0
            for m in range(len(x)):
                square = 0.0
                for k in range(len(inverse)):
                    square += ((z[t, k] - x[m, k]) * inverse[k]) ** 2
                mean += alpha[m, i] * np.exp(-0.5 * square)
            out[t, i] += mean


def _raw(revolute: BoolArray, q: Array, dq: Array, ddq: Array) -> Array:
    angles = q[:, revolute]
    return np.concatenate([np.cos(angles), np.sin(angles), q[:, ~revolute], dq, ddq], axis=1)
