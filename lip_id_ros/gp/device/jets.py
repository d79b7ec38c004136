r"""
Jets of all pairs of samples, written so that torch can differentiate them.

The operators are those of `lip_id_ros.kernels.jets` in two rows of n + 1: the low ones
(1, \partial/\partial dq_i) and the high ones (D, G_i), each high one the rate of the low one at
its place. A jet is then four matrices, low or high on either side, and the product rule reads the
same for all four: a high operator on ay is a times itself on y, plus the rate of a times its low
one on y, less, for G_b alone, da/dq_b times y (docs/maths.md, section 4). Nothing is changed in
place.

"""

from __future__ import annotations

from typing import Any, NamedTuple

import torch

from lip_id_ros.gp.device.factors import Factor, left, right
from lip_id_ros.gp.device.states import TensorStates

Tensor = Any


class Jet(NamedTuple):
    """
    Operators applied to y; tensors of shape (N, M, n + 1, n + 1), or that broadcast to it.

    Attributes
    ----------
    ll, lh, hl, hh : tensors
        Low or high operators of the left (first letter, rows) and of the right.

    """

    ll: Tensor
    lh: Tensor
    hl: Tensor
    hh: Tensor


def zero(x: TensorStates, z: TensorStates) -> Jet:
    """Return the jet of y = 0."""
    m = len(x.dq) + 1
    nothing = x.dq.new_zeros((x.dq.shape[1], z.dq.shape[1], m, m))
    return Jet(nothing, nothing, nothing, nothing)


def multiply(y: Jet, k: Factor, b: int) -> Jet:
    """Return the jet of a(q_b, q'_b) y."""
    ll, lh, hl, hh = y
    own = _unit(ll, b)
    row, column = own[:, None], own[None, :]
    by_q_row = k.by_q * lh[..., :1, :] + k.by_q_rate_z * ll[..., :1, :]
    by_z_column = k.by_z * hl[..., :, :1] + k.by_z_rate * ll[..., :, :1]
    by_q_row = by_q_row - k.by_both * ll[..., :1, :1] * column
    return Jet(
        ll=k.a * ll,
        lh=k.a * lh + k.rate_z * ll - k.by_z * ll[..., :, :1] * column,
        hl=k.a * hl + k.rate * ll - k.by_q * ll[..., :1, :] * row,
        hh=k.a * hh + k.rate * lh + k.rate_z * hl + k.rate_both * ll
        - row * by_q_row - by_z_column * column,
    )  # fmt: skip


def add_velocity(y: Jet, weight: Tensor, x: TensorStates, z: TensorStates, b: int) -> Jet:
    """Return the jet of y + weight dq_b dq'_b."""
    own, first = _unit(y.ll, b), _unit(y.ll, -1)
    low = weight * (left(x.dq[b]) * first + own).transpose(-1, -2)
    high = weight * (left(x.ddq[b]) * first).transpose(-1, -2)
    low_z, high_z = right(z.dq[b]) * first + own, right(z.ddq[b]) * first
    return Jet(y.ll + low * low_z, y.lh + low * high_z, y.hl + high * low_z, y.hh + high * high_z)


def square(y: Jet) -> Tensor:
    """Return G_i G'_j (y^2), shape (N, M, n, n)."""
    total: Tensor = 0.0
    for one, other in zip(y, reversed(y), strict=True):
        total = total + other[..., :1, :1] * one[..., 1:, 1:]
        total = total + one[..., 1:, :1] * other[..., :1, 1:]
    return 2.0 * total


def _unit(like: Tensor, b: int) -> Tensor:
    """Return the row of zeros with 1 at joint b, or at the scalar operator for -1."""
    return torch.eye(like.shape[-1], dtype=like.dtype, device=like.device)[b + 1]
