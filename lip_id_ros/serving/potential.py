"""The posterior mean of the potential energy, contracted over the training samples."""

from __future__ import annotations

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.program import KernelArrays
from lip_id_ros.numba_jit import jit, LANES
from lip_id_ros.serving.contraction import load_factor, Scratch, TrainingSide


@jit
def potential_energy(
    tau: Array, k: KernelArrays, work: Scratch, side: TrainingSide, f: Array, g: Array
) -> float:
    """Return V and add dV/dq to tau, for one query with features f and slopes g."""
    total = 0.0
    if not k.potential_scales.any():
        return total
    for u in range(0, side.dq.shape[1], LANES):
        total += _potential_forward(k, work, side, f, g, u)
        _potential_backward(tau, k, work)
    return total


@jit
def _potential_forward(
    k: KernelArrays, work: Scratch, side: TrainingSide, f: Array, g: Array, u: int
) -> float:
    # x[0] is the product of the factors, x[1] its derivative along alpha.
    x = work.x
    x[0] = 1.0
    x[1] = 0.0
    total = 0.0
    for b in range(k.potential_scales.shape[0]):
        a = work.a[b]
        work.tape[b] = x
        load_factor(a, k.potential_factors[b], f, g, side, u, b)
        for m in range(LANES):
            x[1, m] = a[0, m] * x[1, m] + a[2, m] * x[0, m]
            x[0, m] *= a[0, m]
        total += k.potential_scales[b] * x[1].sum()
    return total


@jit
def _potential_backward(tau: Array, k: KernelArrays, work: Scratch) -> None:
    adj = work.adj
    adj[0] = 0.0
    adj[1] = 0.0
    for b in range(k.potential_scales.shape[0] - 1, -1, -1):
        adj[1] += k.potential_scales[b]
        a, x = work.a[b], work.tape[b]
        total = 0.0
        for m in range(LANES):
            total += adj[0, m] * a[3, m] * x[0, m]
            total += adj[1, m] * (a[3, m] * x[1, m] + a[5, m] * x[0, m])
            adj[0, m] = a[0, m] * adj[0, m] + a[2, m] * adj[1, m]
            adj[1, m] *= a[0, m]
        tau[b] += total
