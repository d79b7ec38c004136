"""Joint factors of all pairs of samples."""

from __future__ import annotations

from typing import Any, NamedTuple

from lip_id_ros.gp.device.states import TensorStates

Tensor = Any


class Factor(NamedTuple):
    """
    A joint factor a(q_b, q'_b) and its derivatives, tensors of shape (N, M, 1, 1).

    Attributes
    ----------
    a, by_q, by_z, by_both : tensors
        a, da/dq, da/dq', d2a/dq dq'.
    rate, rate_z, rate_both : tensors
        Da, D'a, DD'a.
    by_z_rate, by_q_rate_z : tensors
        D(da/dq'), D'(da/dq).

    """

    a: Tensor
    by_q: Tensor
    by_z: Tensor
    by_both: Tensor
    rate: Tensor
    rate_z: Tensor
    rate_both: Tensor
    by_z_rate: Tensor
    by_q_rate_z: Tensor


def joint_factor(w: Tensor, x: TensorStates, z: TensorStates, b: int) -> Factor:
    """Evaluate the factor of joint b, of weights w = (w_0, w_1, w_2), between all x and all z."""
    dq, dz = left(x.dq[b]), right(z.dq[b])

    def inner(one: Tensor, other: Tensor) -> Tensor:
        first = w[1] * left(one[0, b]) * right(other[0, b])
        return first + w[2] * left(one[1, b]) * right(other[1, b])

    by_q, by_z, by_both = inner(x.g, z.f), inner(x.f, z.g), inner(x.g, z.g)
    return Factor(
        a=w[0] + inner(x.f, z.f),
        by_q=by_q,
        by_z=by_z,
        by_both=by_both,
        rate=dq * by_q,
        rate_z=dz * by_z,
        rate_both=dq * dz * by_both,
        by_z_rate=dq * by_both,
        by_q_rate_z=dz * by_both,
    )


def square(k: Factor) -> Factor:
    """Return a factor's square, without the rates."""
    return k._replace(
        a=k.a**2,
        by_q=2.0 * k.a * k.by_q,
        by_z=2.0 * k.a * k.by_z,
        by_both=2.0 * (k.by_q * k.by_z + k.a * k.by_both),
    )


def left(values: Tensor) -> Tensor:
    """Lay values of the first samples, shape (N,), along the pairs, shape (N, 1, 1, 1)."""
    return values[:, None, None, None]


def right(values: Tensor) -> Tensor:
    """Lay values of the second samples, shape (M,), along the pairs, shape (1, M, 1, 1)."""
    return values[None, :, None, None]
