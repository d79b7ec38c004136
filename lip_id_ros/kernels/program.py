r"""
Energy kernels as short programs, and their weights.

The kinetic energy kernel is a sum over the links of squares of velocity kernels,

.. math:: k_T = \sum_i \lambda_i\, y_i^2, \qquad
          y_i = \sum_{j \le i} v_j \prod_{b \in B_{ij}} a_b, \qquad v_j = s_j \dot q_j \dot q'_j,

and the members of the family differ only in the joints B_ij whose factors a_b(q, q') multiply a
velocity term (maths.md, section 3). A program composes the y_i: its steps act on one running
y, which they multiply by a factor, add a velocity term to, or emit the square of. The potential
energy kernel is a product of factors. Whoever evaluates a kernel (Gram matrix, gradient,
prediction, reference) interprets the same steps, and a new member of the family is a new list.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IntArray


class Operation(IntEnum):
    """Effects of a step on the running velocity kernel y."""

    RESET = 0  # y = 0
    MULTIPLY = 1  # y = a_b y
    ADD = 2  # y = y + s_b dq_b dq'_b
    SQUARE = 3  # emit lambda_i y^2


class Step(NamedTuple):
    """
    One step of a program; a row of `EnergyKernel.steps`.

    `coupled`, `high`: before the step, y depends on joints 0..high-1 (at a reset, those that it
    will depend on), and derivatives by two different joints vanish unless one of them is below
    `coupled`.
    """

    operation: int
    joint: int
    factor_set: int
    link: int
    coupled: int
    high: int


@dataclass(frozen=True)
class EnergyKernel:
    """Which joints the entries of the inertia matrix and the potential energy may depend on."""

    name: str  # as in `lip_id fit --kernel`
    n_joints: int
    steps: IntArray  # (n_steps, 6), rows as in `Step`
    n_factor_sets: int  # 1 where links share factors and weights, or n
    potential_links: IntArray  # after whose factor the product is emitted


class Weights(NamedTuple):
    """Positive hyperparameters of an energy kernel."""

    factors: Array  # (n_factor_sets, n, 3): w_0, w_1, w_2 of T's factors
    velocities: Array  # (n_factor_sets, n): weights s
    kinetic_scales: Array  # (n,): lambda of every link [J^2 up to s]
    potential_factors: Array  # (n, 3): w_0, w_1, w_2 of V's factors
    potential_scales: Array  # (n_potential_links,) [J^2]


class KernelArrays(NamedTuple):
    """An energy kernel with its weights, laid out for compiled loops."""

    steps: IntArray  # (n_steps, 6), as in `EnergyKernel`
    bounds: IntArray  # where runs after a reset begin, and the end
    factors: Array
    velocities: Array
    kinetic_scales: Array
    potential_factors: Array
    potential_scales: Array  # (n,), 0 where nothing is emitted


def unit_weights(kernel: EnergyKernel) -> Weights:
    """Return weights of one, in the shapes that a kernel needs."""
    n, sets = kernel.n_joints, kernel.n_factor_sets
    return Weights(
        factors=np.ones((sets, n, 3)),
        velocities=np.ones((sets, n)),
        kinetic_scales=np.ones(n),
        potential_factors=np.ones((n, 3)),
        potential_scales=np.ones(len(kernel.potential_links)),
    )


def kernel_arrays(kernel: EnergyKernel, weights: Weights) -> KernelArrays:
    """Lay a kernel and its weights out for compiled loops."""
    potential_scales = np.zeros(kernel.n_joints)
    potential_scales[kernel.potential_links] = weights.potential_scales
    resets = np.flatnonzero(kernel.steps[:, 0] == Operation.RESET)
    bounds = np.append(resets, len(kernel.steps))
    return KernelArrays(kernel.steps, bounds, *weights[:-1], potential_scales)


def recursive(n_joints: int) -> EnergyKernel:
    """
    Compose link velocities from base to tip, with factors shared by all links.

    y_i = a_i y_{i-1} + v_i with v_i = s_i dq_i dq'_i.

    The recursion of the Newton-Euler velocities: an entry M_jk depends on the joints beyond j,
    with degree one up to k and two beyond. The inertia matrix never depends on the first joint.
    """
    steps = [Step(Operation.RESET, 0, 0, 0, 0, n_joints)]
    for b in range(n_joints):
        if b > 0:
            steps.append(Step(Operation.MULTIPLY, b, 0, 0, b, b))
        steps.append(Step(Operation.ADD, b, 0, 0, b, b))
        steps.append(Step(Operation.SQUARE, 0, 0, b, b + 1, b + 1))
    return _kernel('recursive', n_joints, steps, n_factor_sets=1)


def lip(n_joints: int) -> EnergyKernel:
    """
    Build the kernel of the paper (eqs. `kinetic_LGI` and `potential-kernel`).

    Every entry of link i's inertia depends on all joints up to i, with degree two: y_i is the sum
    of all velocity terms times the product of all factors. The potential energy is one product
    over all joints.
    """
    steps: list[Step] = []
    for i in range(n_joints):
        end = i + 1
        steps.append(Step(Operation.RESET, 0, i, 0, 0, end))
        steps.extend(Step(Operation.ADD, b, i, 0, 0, end) for b in range(end))
        steps.extend(Step(Operation.MULTIPLY, b, i, 0, b, end) for b in range(end))
        steps.append(Step(Operation.SQUARE, 0, i, i, end, end))
    kernel = _kernel('lip', n_joints, steps, n_factor_sets=n_joints)
    return with_potential_after(kernel, [n_joints - 1])


FAMILY = {kernel.__name__: kernel for kernel in (recursive, lip)}
"""Every energy kernel by its name."""


def without_potential(kernel: EnergyKernel) -> EnergyKernel:
    """Return the kernel with no potential energy, for torques that leave gravity out."""
    return with_potential_after(kernel, [])


def with_potential_after(kernel: EnergyKernel, links: Iterable[int]) -> EnergyKernel:
    """Return the kernel with the running product emitted after the factors of the given links."""
    return replace(kernel, potential_links=np.array(list(links), dtype=np.int64))


def _kernel(name: str, n_joints: int, steps: Sequence[Step], n_factor_sets: int) -> EnergyKernel:
    table = np.array(steps, dtype=np.int64).reshape(len(steps), len(Step._fields))
    return EnergyKernel(name, n_joints, table, n_factor_sets, np.arange(n_joints))


def factor(w: Any, f: Any, fz: Any, b: int) -> Any:
    """Return w_0 + w_1 f_1 f_1' + w_2 f_2 f_2' of joint b; see `kinetic_covariance`."""
    return w[0] + w[1] * f[0][b] * fz[0][b] + w[2] * f[1][b] * fz[1][b]


def kinetic_covariance(
    kernel: EnergyKernel, weights: Weights, f: Any, dq: Any, fz: Any, dz: Any
) -> Any:
    """
    Prior covariance [J^2] of the kinetic energies at two joint states: defines a kernel.

    It takes numbers, numpy arrays and torch tensors alike. numpy gives prior variances; torch
    differentiates these lines to give torques, which the tests compare with every compiled loop.

    `f`, `fz`: joint features of the two states; further indices are states. `dq`, `dz`: velocities
    [rad/s or m/s].
    """
    y: Any = 0.0
    total: Any = 0.0
    for operation, b, group, link, _, _ in kernel.steps.tolist():
        if operation == Operation.RESET:
            y = 0.0
        elif operation == Operation.MULTIPLY:
            y = y * factor(weights.factors[group, b], f, fz, b)
        elif operation == Operation.ADD:
            y = y + weights.velocities[group, b] * dq[b] * dz[b]
        elif operation == Operation.SQUARE:
            total = total + weights.kinetic_scales[link] * y * y
    return total


def potential_covariance(kernel: EnergyKernel, weights: Weights, f: Any, fz: Any) -> Any:
    """Prior covariance of the potential energies [J^2]; parameters as in `kinetic_covariance`."""
    product: Any = 1.0
    total: Any = 0.0
    links = kernel.potential_links.tolist()
    for b in range(kernel.n_joints):
        product = product * factor(weights.potential_factors[b], f, fz, b)
        if b in links:
            total = total + weights.potential_scales[links.index(b)] * product
    return total
