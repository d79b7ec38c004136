"""Inertia entries that share their product, as in `lip_id_ros.kernels.entries`, on tensors."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch

from lip_id_ros.gp.device.products import Product
from lip_id_ros.gp.device.states import TensorStates

Tensor = Any


class _Sum(NamedTuple):
    """
    A sum of velocity terms s_j dq_j dq'_j, with D, D' and DD' of it, shape (N, M, 1, 1).

    Attributes
    ----------
    one, d, dz, both : tensors

    """

    one: Tensor
    d: Tensor
    dz: Tensor
    both: Tensor


def torque_block(
    p: Product, s: Tensor, x: TensorStates, z: TensorStates, low: int, middle: int, high: int
) -> Tensor:
    """Return G_i G'_j (w p) with w = v (v + 2 t), shape (N, M, n, n)."""
    joints = torch.arange(len(s), device=s.device)
    near = s * ((joints >= low) & (joints < middle))
    far = s * ((joints >= middle) & (joints < high))
    v, t = _sum(near, x, z), _sum(far, x, z)
    # slopes of w by every joint's term: 2 (v + t) by the near ones, 2 v by the far ones
    g = _Sum(*(2.0 * (near * (one + other) + far * one) for one, other in zip(v, t, strict=True)))
    w = v.one * (v.one + 2.0 * t.one)
    dq, ddq = x.dq.T[:, None, :, None], x.ddq.T[:, None, :, None]
    dz, ddz = z.dq.T[None, :, None, :], z.ddq.T[None, :, None, :]
    by_z, by_q = (dq * p.h).sum(-2, keepdim=True), (p.h * dz).sum(-1, keepdim=True)
    rate, rate_z = (dq * p.r).sum(-2, keepdim=True), (p.c * dz).sum(-1, keepdim=True)
    both = (dq * by_q).sum(-2, keepdim=True)
    rows, columns = _transposed(dz), _transposed(dq)
    low_rows, high_rows = _transposed(g.one) * rows, _transposed(g.d) * rows
    low_columns, high_columns = g.one * columns, g.dz * columns
    block = w * p.h - high_rows * p.c - low_rows * by_z - p.r * high_columns - by_q * low_columns
    pairs = 2.0 * (near[:, None] * (near + far) + far[:, None] * near)
    block = block + pairs * (
        rows * (columns * both + _transposed(ddq) * rate_z)
        + _transposed(ddz) * (columns * rate + _transposed(ddq) * p.p)
    )
    diagonal = g.one * both + g.d * rate_z + g.dz * rate + g.both * p.p
    return block + torch.eye(len(s), dtype=s.dtype, device=s.device) * diagonal


def _sum(s: Tensor, x: TensorStates, z: TensorStates) -> _Sum:
    def inner(one: Tensor, other: Tensor) -> Tensor:
        return ((s[:, None] * one).T @ other)[:, :, None, None]

    return _Sum(inner(x.dq, z.dq), inner(x.ddq, z.dq), inner(x.dq, z.ddq), inner(x.ddq, z.ddq))


def _transposed(tensor: Tensor) -> Tensor:
    return tensor.transpose(-1, -2)
