"""
The definition of the energy kernels, in a few lines.

They take numbers, numpy arrays and torch tensors alike: numpy gives prior variances; torch
differentiates these lines to give torques (`lip_id_ros.gp.reference`), which every compiled loop
is tested against (docs/maths.md, section 3).

"""

from __future__ import annotations

from typing import Any

from lip_id_ros.kernels.program import EnergyKernel, Operation, Weights


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
