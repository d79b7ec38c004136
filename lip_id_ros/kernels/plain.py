"""
The energy kernels themselves, as plainly as they can be written.

They take numbers, numpy arrays or torch tensors alike. With torch, nested automatic
differentiation of these few lines is the oracle for every fused loop (docs/maths.md, section 3);
with numpy they give the prior variances.

"""

from __future__ import annotations

from typing import Any

from lip_id_ros.kernels.program import (
    ADD,
    EMIT,
    EnergyKernel,
    EXTEND,
    MULTIPLY,
    RESET,
    SQUARE,
    START,
)
from lip_id_ros.kernels.weights import Weights


def factor(w: Any, f: Any, fz: Any, b: int) -> Any:
    """Return w_0 + w_1 f_1 f_1' + w_2 f_2 f_2' of joint b."""
    return w[0] + w[1] * f[0][b] * fz[0][b] + w[2] * f[1][b] * fz[1][b]


def kinetic_covariance(
    kernel: EnergyKernel, weights: Weights, f: Any, dq: Any, fz: Any, dz: Any
) -> Any:
    """
    Prior covariance of the kinetic energies at two joint states.

    Parameters
    ----------
    kernel : EnergyKernel
    weights : Weights
    f, fz : array-likes, first indices (2, n)
        Joint features of the two states; further indices are states.
    dq, dz : array-likes, first index n
        Velocities [rad/s or m/s].

    Returns
    -------
    array-like
        [J^2].

    """
    states = (weights, f, dq, fz, dz)
    return _squares(kernel, *states) + _entries(kernel, *states)


def _squares(kernel: EnergyKernel, weights: Weights, f: Any, dq: Any, fz: Any, dz: Any) -> Any:
    y: Any = 0.0
    total: Any = 0.0
    for operation, b, group, link, _, _ in kernel.squares:
        if operation == RESET:
            y = 0.0
        elif operation == MULTIPLY:
            y = y * factor(weights.factors[group, b], f, fz, b)
        elif operation == ADD:
            y = y + weights.velocities[group, b] * dq[b] * dz[b]
        elif operation == SQUARE:
            total = total + weights.kinetic_scales[link] * y * y
    return total


def _entries(kernel: EnergyKernel, weights: Weights, f: Any, dq: Any, fz: Any, dz: Any) -> Any:
    product: Any = 1.0
    total: Any = 0.0
    for operation, b, link, low, middle, high in kernel.entries:
        if operation == START:
            product = 1.0
        elif operation == EXTEND:
            product = product * factor(weights.factors[link, b], f, fz, b) ** 2
        elif operation == EMIT:
            v = [weights.velocities[link, j] * dq[j] * dz[j] for j in range(low, high)]
            near, far = sum(v[: middle - low]), sum(v[middle - low :])
            total = total + weights.kinetic_scales[link] * near * (near + 2.0 * far) * product
    return total


def potential_covariance(kernel: EnergyKernel, weights: Weights, f: Any, fz: Any) -> Any:
    """Prior covariance of the potential energies [J^2]; parameters as in `kinetic_covariance`."""
    product: Any = 1.0
    total: Any = 0.0
    links = list(kernel.potential_links)
    for b in range(kernel.n_joints):
        product = product * factor(weights.potential_factors[b], f, fz, b)
        if b in links:
            total = total + weights.potential_scales[links.index(b)] * product
    return total
