r"""
Energy kernels as short programs of three steps.

The kinetic energy kernel of link i is the square of a kernel y on that link's velocity,

.. math:: k_T = \sum_i \lambda_i\, y_i(x, x')^2, \qquad
          y_i = \sum_j s_j \dot q_j \dot q'_j \; \prod_{b \in B_{ij}} a_b(q, q')

and the members of the family differ only in the joints B_ij whose factors a_b enter
(docs/maths.md, section 3). So a kernel is a list of steps on one running y: multiply by a factor,
add a velocity term, emit the square. The potential energy kernel is a product of factors, emitted
as it is. Whoever evaluates a kernel (Gram matrix, gradient, serving, plain oracle) interprets the
same steps, and a new member of the family is a new list.

"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

RESET, MULTIPLY, ADD, SQUARE = 0, 1, 2, 3
COLUMNS = ('operation', 'joint', 'factor_set', 'scale', 'low', 'high')

Step = tuple[int, int, int, int, int, int]


@dataclass(frozen=True)
class EnergyKernel:
    """
    Which joints the entries of the inertia matrix and the potential energy may depend on.

    Attributes
    ----------
    name : str
        As in `lip_id fit --kernel`.
    n_joints : int
    kinetic : int array, shape (n_steps, 6)
        Steps with the columns `COLUMNS`; `low` and `high` bound the joints that y depends on
        before the step; at a reset, those that it will depend on until the next.
    n_factor_sets : int
        1 where all links share joint factors and velocity weights, n where each has its own.
    kinetic_signs : float array, shape (n_scales,)
        Times the scale of link `kinetic_links[k]`, the weight of the square with scale number k:
        +1 or -1.
    kinetic_links : int array, shape (n_scales,)
    potential_links : int array
        The links after whose factor the running product is emitted.

    """

    name: str
    n_joints: int
    kinetic: NDArray[np.int64]
    n_factor_sets: int
    kinetic_signs: NDArray[np.float64]
    kinetic_links: NDArray[np.int64]
    potential_links: NDArray[np.int64]


def recursive(n_joints: int) -> EnergyKernel:
    """
    Compose link velocities from base to tip, with factors shared by all links.

    y_i = a_i y_{i-1} + v_i with v_i = s_i dq_i dq'_i.

    The recursion of the Newton-Euler velocities: an entry M_jk depends on the joints beyond j,
    with degree one up to k and two beyond. The inertia matrix never depends on the first joint.

    """
    steps: list[Step] = [(RESET, 0, 0, 0, 0, n_joints)]
    for b in range(n_joints):
        if b > 0:
            steps.append((MULTIPLY, b, 0, 0, 0, b))
        steps.append((ADD, b, 0, 0, 0, b))
        steps.append((SQUARE, 0, 0, b, 0, b + 1))
    return _kernel('recursive', n_joints, steps, 1, _every_link(n_joints))


def recursive_per_link(n_joints: int) -> EnergyKernel:
    """As `recursive`, with factors and velocity weights of its own for every link."""
    steps: list[Step] = []
    for i in range(n_joints):
        steps.append((RESET, 0, i, 0, 0, i + 1))
        for b in range(i + 1):
            if b > 0:
                steps.append((MULTIPLY, b, i, 0, 0, b))
            steps.append((ADD, b, i, 0, 0, b))
        steps.append((SQUARE, 0, i, i, 0, i + 1))
    return _kernel('recursive_per_link', n_joints, steps, n_joints, _every_link(n_joints))


def lip(n_joints: int) -> EnergyKernel:
    """
    Build the kernel of the paper (eqs. `kinetic_LGI` and `potential-kernel`).

    Every entry of link i's inertia depends on all joints up to i, with degree two; the potential
    energy is one product over all joints.

    """
    steps: list[Step] = []
    for i in range(n_joints):
        steps.append((RESET, 0, i, 0, 0, i + 1))
        steps.extend((ADD, b, i, 0, 0, b) for b in range(i + 1))
        steps.extend((MULTIPLY, b, i, 0, 0, i + 1) for b in range(i + 1))
        steps.append((SQUARE, 0, i, i, 0, i + 1))
    return _kernel('lip', n_joints, steps, n_joints, np.array([n_joints - 1]))


def nested(n_joints: int) -> EnergyKernel:
    """
    Entries that depend only on the joints beyond min(j, k), with degree two.

    For each link, the entries with min(j, k) = m are the difference of the squares of the velocity
    sums from m and from m + 1 on, both times the factors beyond m. One run per m emits the first
    of them and, times one factor more, the second of those of m - 1.

    """
    steps: list[Step] = []
    for i in range(n_joints):
        for m in range(i + 1):
            steps.append((RESET, 0, i, 0, m, i + 1))
            steps.extend((ADD, b, i, 0, m, b) for b in range(m, i + 1))
            steps.extend((MULTIPLY, b, i, 0, m, i + 1) for b in range(m + 1, i + 1))
            steps.append((SQUARE, 0, i, i, m, i + 1))
            if m > 0:
                steps.append((MULTIPLY, m, i, 0, m, i + 1))
                steps.append((SQUARE, 0, i, n_joints + i, m, i + 1))
    signs = np.repeat([1.0, -1.0], n_joints)
    return _kernel('nested', n_joints, steps, n_joints, _every_link(n_joints), signs)


FAMILY = {kernel.__name__: kernel for kernel in (recursive, recursive_per_link, nested, lip)}


def without_potential(kernel: EnergyKernel) -> EnergyKernel:
    """Return the kernel with no potential energy, for torques that leave gravity out."""
    return with_potential_after(kernel, [])


def with_product_potential(kernel: EnergyKernel) -> EnergyKernel:
    """Return the kernel with the paper's potential energy: one product over all joints."""
    return with_potential_after(kernel, [kernel.n_joints - 1])


def with_potential_per_link(kernel: EnergyKernel) -> EnergyKernel:
    """Return the kernel with one potential energy for every link, the product up to it."""
    return with_potential_after(kernel, range(kernel.n_joints))


def with_potential_after(kernel: EnergyKernel, links: Iterable[int]) -> EnergyKernel:
    """Return the kernel with the running product emitted after the factors of the given links."""
    return replace(kernel, potential_links=np.array(list(links), dtype=np.int64))


def with_own_potential(kernel: EnergyKernel) -> EnergyKernel:
    """Return the kernel as the family has it."""
    return kernel


POTENTIALS = {
    'kernel': with_own_potential,
    'product': with_product_potential,
    'per_link': with_potential_per_link,
}


def _every_link(n_joints: int) -> NDArray[np.int64]:
    return np.arange(n_joints)


def _kernel(
    name: str,
    n_joints: int,
    steps: list[Step],
    n_factor_sets: int,
    potential_links: NDArray[np.int64],
    signs: NDArray[np.float64] | None = None,
) -> EnergyKernel:
    signs = np.ones(n_joints) if signs is None else signs
    return EnergyKernel(
        name=name,
        n_joints=n_joints,
        kinetic=np.array(steps, dtype=np.int64),
        n_factor_sets=n_factor_sets,
        kinetic_signs=signs,
        kinetic_links=np.arange(len(signs)) % n_joints,
        potential_links=potential_links,
    )
