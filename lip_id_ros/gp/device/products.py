"""The potential energy kernel's running product for all pairs of samples."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch

from lip_id_ros.gp.device.factors import Factor
from lip_id_ros.gp.device.states import TensorStates

Tensor = Any


class Product(NamedTuple):
    """
    A product of the factors of the first b joints.

    Attributes
    ----------
    p : tensor, shape (N, M, 1, 1)
    r, c : tensors, shapes (N, M, b, 1) and (N, M, 1, b)
        dp/dq_i and dp/dq'_j.
    h : tensor, shape (N, M, b, b)
        d2p/dq_i dq'_j.

    """

    p: Tensor
    r: Tensor
    c: Tensor
    h: Tensor


def one(x: TensorStates, z: TensorStates) -> Product:
    """Return the product of no factors."""
    pairs = (x.dq.shape[1], z.dq.shape[1])
    new = x.dq.new_zeros
    return Product(
        x.dq.new_ones((*pairs, 1, 1)),
        new((*pairs, 0, 1)),
        new((*pairs, 1, 0)),
        new((*pairs, 0, 0)),
    )


def extend(x: Product, k: Factor) -> Product:
    """Return the product with one joint's factor more."""
    above = torch.cat([k.a * x.h, k.by_z * x.r], dim=-1)
    below = torch.cat([k.by_q * x.c, k.by_both * x.p], dim=-1)
    return Product(
        p=k.a * x.p,
        r=torch.cat([k.a * x.r, k.by_q * x.p], dim=-2),
        c=torch.cat([k.a * x.c, k.by_z * x.p], dim=-1),
        h=torch.cat([above, below], dim=-2),
    )


def curvature(x: Product, n: int) -> Tensor:
    """Return d2p/dq_i dq'_j of all n joints, zero for those not in the product."""
    rest = n - x.h.shape[-1]
    return torch.nn.functional.pad(x.h, (0, rest, 0, rest))
