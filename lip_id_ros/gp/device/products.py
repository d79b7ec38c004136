"""A running product of joint factors for all pairs of samples."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch

from lip_id_ros.gp.device.factors import Factor
from lip_id_ros.gp.device.states import TensorStates

Tensor = Any


class Product(NamedTuple):
    """
    A product of joint factors.

    Attributes
    ----------
    p : tensor, shape (N, M, 1, 1)
    r, c : tensors, shapes (N, M, n, 1) and (N, M, 1, n), or that broadcast to them
        dp/dq_i and dp/dq'_j.
    h : tensor, shape (N, M, n, n), or that broadcasts to it
        d2p/dq_i dq'_j.

    """

    p: Tensor
    r: Tensor
    c: Tensor
    h: Tensor


def one(x: TensorStates, z: TensorStates) -> Product:
    """Return the product of no factors."""
    n, new = len(x.dq), x.dq.new_zeros
    whole = x.dq.new_ones((x.dq.shape[1], z.dq.shape[1], 1, 1))
    return Product(whole, new((1, 1, n, 1)), new((1, 1, 1, n)), new((1, 1, n, n)))


def extend(x: Product, k: Factor, b: int) -> Product:
    """Return the product with the factor of joint b, on which it does not depend yet."""
    column = torch.eye(x.h.shape[-1], dtype=x.p.dtype, device=x.p.device)[b]
    row = column[:, None]
    return Product(
        p=k.a * x.p,
        r=k.a * x.r + k.by_q * x.p * row,
        c=k.a * x.c + k.by_z * x.p * column,
        h=k.a * x.h
        + row * (k.by_q * x.c)
        + (k.by_z * x.r) * column
        + k.by_both * x.p * row * column,
    )
