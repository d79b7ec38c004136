r"""
Energy kernels as short programs.

The kinetic energy kernel of link i is a sum over the entries (j, k) of its inertia matrix,

.. math:: k_{T_i} = \lambda_i \sum_{jk} v_j v_k \prod_b a_b^{d_b(j, k)}, \qquad
          v_j = s_j \dot q_j \dot q'_j,

and the members of the family differ only in the degree d_b to which the factor a_b(q, q') of a
joint enters an entry (docs/maths.md, section 3). There are two ways to sum many entries at once,
and a program of steps for each. Where the sum is the square of a kernel y on velocities, the
steps act on one running y: multiply by a factor, add a velocity term, emit the square. Where
entries share their product of squared factors, the steps act on one running product: extend it by
a joint, emit the entries that it belongs to. The potential energy kernel is a product of factors,
emitted as it is. Whoever evaluates a kernel (Gram matrix, gradient, serving, plain oracle)
interprets the same steps, and a new member of the family is a new list.

"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import IntArray

RESET, MULTIPLY, ADD, SQUARE = 0, 1, 2, 3
START, EXTEND, EMIT = 0, 1, 2

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
    squares : int array, shape (n_steps, 6)
        Steps on a running velocity kernel y: operation, joint, factor set, link, low, high. Before
        the step, y depends on joints low..high-1; at a reset, those that it will depend on.
    entries : int array, shape (n_steps, 6)
        Steps on a running product of squared factors: operation, joint, link, low, middle, high.
        Before an extension the product depends on joints low..high-1, at a start on those that it
        will depend on. What is emitted are the entries whose lower index is in low..middle-1 and
        whose higher one is below `high`.
    n_factor_sets : int
        1 where all links share joint factors and velocity weights, n where each has its own.
    potential_links : int array
        The links after whose factor the running product is emitted.

    """

    name: str
    n_joints: int
    squares: IntArray
    entries: IntArray
    n_factor_sets: int
    potential_links: IntArray

    @property
    def is_empty(self) -> bool:
        """Whether there are no energies."""
        return not (len(self.squares) or len(self.entries) or len(self.potential_links))


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
    return _kernel('recursive', n_joints, squares=steps, n_factor_sets=1)


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
    return _kernel('recursive_per_link', n_joints, squares=steps)


def lip(n_joints: int) -> EnergyKernel:
    """
    Build the kernel of the paper (eqs. `kinetic_LGI` and `potential-kernel`).

    Every entry of link i's inertia depends on all joints up to i, with degree two; the potential
    energy is one product over all joints.

    """
    steps: list[Step] = []
    for i in range(n_joints):
        end = i + 1
        steps.append((START, 0, i, 0, 0, end))
        steps.extend((EXTEND, b, i, b + 1, b + 1, end) for b in range(i, -1, -1))
        steps.append((EMIT, 0, i, 0, end, end))
    return with_product_potential(_kernel('lip', n_joints, entries=steps))


def nested(n_joints: int) -> EnergyKernel:
    """
    Entries that depend only on the joints beyond min(j, k), with degree two.

    From a link's own joint down to the base: emit the entries of the joint at hand with those
    beyond, then extend the product by its factor.

    """
    steps: list[Step] = []
    for i in range(n_joints):
        end = i + 1
        steps.append((START, 0, i, 0, 0, end))
        for b in range(i, -1, -1):
            steps.append((EMIT, b, i, b, b + 1, end))
            if b > 0:
                steps.append((EXTEND, b, i, b + 1, b + 1, end))
    return _kernel('nested', n_joints, entries=steps)


def none(n_joints: int) -> EnergyKernel:
    """Return no energies, for what rigid links explain by themselves."""
    kernel = with_potential_after(_kernel('none', n_joints), [])
    return replace(kernel, n_factor_sets=0)


FAMILY = {kernel.__name__: kernel for kernel in (recursive, recursive_per_link, nested, lip)}
ENERGIES = {**FAMILY, 'none': none}
"""Every energy kernel by its name; those of the family can do without rigid links."""


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


def _kernel(
    name: str,
    n_joints: int,
    squares: Sequence[Step] = (),
    entries: Sequence[Step] = (),
    n_factor_sets: int | None = None,
) -> EnergyKernel:
    return EnergyKernel(
        name=name,
        n_joints=n_joints,
        squares=_table(squares),
        entries=_table(entries),
        n_factor_sets=n_factor_sets or n_joints,
        potential_links=np.arange(n_joints),
    )


def _table(steps: Sequence[Step]) -> IntArray:
    return np.array(steps, dtype=np.int64).reshape(len(steps), 6)
