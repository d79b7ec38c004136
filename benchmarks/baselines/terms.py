"""
Covariance terms of one joint's torque; single-output Gaussian processes are sums of them.

A term turns motions into features once, in NumPy, and its covariance is a function of those and of
log-hyperparameters that torch differentiates.

"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

import numpy as np
import torch

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import JointBasis


class Motion(NamedTuple):
    """Positions, velocities, accelerations, each (N, n)."""

    q: Array
    dq: Array
    ddq: Array


class Term(Protocol):
    """One summand of the covariance of a joint's torque."""

    def features(self, motion: Motion) -> Array:
        """Return the features of N motions, shape (N, d)."""

    def initial_guess(self, features: Array) -> Array:
        """Return initial log-hyperparameters (p,), for torques of unit variance."""

    def gram(self, theta: torch.Tensor, x: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
        """Return the covariance (N, M) of features (N, d) and (M, d)."""


MakeTerm = Callable[[JointBasis, int], Term]
"""From the features of an arm and the number of a joint to a term."""


class SquaredExponential:
    """
    The universal kernel, with a length scale for every feature (paper, eq. K-SE).

    Features: cos q and sin q of revolute joints and q of prismatic ones, dq, ddq.

    """

    def __init__(self, basis: JointBasis, joint: int) -> None:
        self._basis = basis

    def features(self, motion: Motion) -> Array:
        """Return the features of all joints, shape (N, about 4 n)."""
        return np.hstack([positions(motion.q, self._basis), motion.dq, motion.ddq])

    def initial_guess(self, features: Array) -> Array:
        """Return a guess: unit variance and lengths at which typical samples are correlated."""
        deviation = features.std(axis=0)
        lengths = np.sqrt(features.shape[1]) * np.where(deviation > 0, deviation, 1.0)
        return np.log(np.concatenate([[1.0], lengths]))

    def gram(self, theta: torch.Tensor, x: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
        """Return lambda exp(-|x - z|^2 / 2) in units of the length scales."""
        inverse = torch.exp(-theta[1:])
        return torch.exp(theta[0] - 0.5 * squared_distance(x * inverse, z * inverse))


class GeometricPolynomial:
    r"""
    The geometrically inspired polynomial kernel (Dalla Libera and Carli, RA-L 2020).

    .. math:: k = k^{(1)}_{av} \prod_{b} k^{(2)}_{b}

    A joint's torque is linear in ddq and in the products dq_i dq_j (a_v), gravity being the
    constant, and of degree two in (cos q_b, sin q_b) or q_b of each joint. Factors of degree p are
    products of p linear kernels, each with weights of its own (multiplicative polynomial kernel).

    """

    degree = 2

    def __init__(self, basis: JointBasis, joint: int) -> None:
        self._basis = basis

    def features(self, motion: Motion) -> Array:
        """Return f_1, f_2 of every joint, then ddq and the products of velocities."""
        f, _ = self._basis.features(motion.q)
        rows, columns = np.triu_indices(self._basis.n_joints)
        products = motion.dq[:, rows] * motion.dq[:, columns]
        return np.hstack([f[0].T, f[1].T, motion.ddq, products])

    def initial_guess(self, features: Array) -> Array:
        """Return a guess: factors of about one."""
        n = self._basis.n_joints
        moving = features[:, 2 * n :]
        power = np.mean(np.square(moving), axis=0) * moving.shape[1]
        weights = 1.0 / np.where(power > 0, power, 1.0)
        geometry = np.full(self.degree * 3 * n, 0.5)
        return np.log(np.concatenate([geometry, [1.0], weights]))

    def gram(self, theta: torch.Tensor, x: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
        """Return the product of the factors of all joints and of the linear one."""
        n = self._basis.n_joints
        weights = torch.exp(theta)
        geometry = weights[: self.degree * 3 * n].reshape(self.degree, n, 3)
        moving = weights[self.degree * 3 * n :]
        x_moving, z_moving = x[:, 2 * n :], z[:, 2 * n :]
        product = moving[0] + (x_moving * moving[1:]) @ z_moving.T
        for b in range(n):
            first = x[:, b, None] * z[None, :, b]
            second = x[:, n + b, None] * z[None, :, n + b]
            for power in range(self.degree):
                offset, one, other = geometry[power, b]
                product = product * (offset + one * first + other * second)
        return product


class Linear:
    """phi(x) Gamma phi(z)^T with a diagonal Gamma (paper, eq. K-SP and kernel_epsilon)."""

    def initial_guess(self, features: Array) -> Array:
        """Return a guess: features that contribute equally."""
        power = np.mean(np.square(features), axis=0) * features.shape[1]
        return -np.log(np.where(power > 0, power, 1.0))

    def gram(self, theta: torch.Tensor, x: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
        """Return the weighted product of the features."""
        return (x * torch.exp(theta)) @ z.T


class Friction(Linear):
    """Viscous and Coulomb friction of a joint (paper, eq. kernel_epsilon)."""

    def __init__(self, basis: JointBasis, joint: int) -> None:
        self._joint = joint

    def features(self, motion: Motion) -> Array:
        """Return dq and sign(dq) of the joint, shape (N, 2)."""
        dq = motion.dq[:, self._joint]
        return np.column_stack([dq, np.sign(dq)])


def positions(q: Array, basis: JointBasis) -> Array:
    """Return cos q and sin q of revolute joints, the scaled q of prismatic ones, (N, m)."""
    f, _ = basis.features(q)
    return np.hstack([f[0].T, f[1][~basis.prismatic].T])


def squared_distance(x: torch.Tensor, z: torch.Tensor) -> torch.Tensor:
    """Return |x_i - z_j|^2, shape (N, M)."""
    product = x @ z.T
    both = x.square().sum(1)[:, None] + z.square().sum(1)
    return (both - 2.0 * product).clamp_min(0.0)


TERMS: Mapping[str, MakeTerm] = {
    'squared_exponential': SquaredExponential,
    'geometric_polynomial': GeometricPolynomial,
    'friction': Friction,
}
"""Terms by name."""
