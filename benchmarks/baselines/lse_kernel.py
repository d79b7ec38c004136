r"""
Torques of a Lagrangian with a squared-exponential prior, in closed form.

With features z = (cos q, sin q, dq) in units of their length scales and L ~ GP(0, k),
k = exp(-\|u\|^2 / 2), u = z - z', the Euler-Lagrange operator is

.. math:: \mathcal{G}_i L = D^2 L[\dot z, w_i] - D L[v_i],

where \dot z is the velocity of the features along the motion, w_i their derivative by dq_i, and
v_i that by q_i; nothing else appears, since the features are linear in dq. Applied on both sides,
derivatives of the Gaussian up to the fourth order remain, which are Hermite polynomials in the
projections of u. Only w_i and z' share components with the same w_i, only v_i with the same v_i,
so that the block of two samples is a sum of four outer products and a diagonal.

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import JointBasis


@dataclass(frozen=True)
class States:
    """
    N samples as the kernel uses them; dq and ddq have shape (N, n).

    `f` and `g`, shape (2, N, n), are the features of the positions (cos q and sin q, or q and 0)
    and their derivatives.

    """

    f: torch.Tensor
    g: torch.Tensor
    dq: torch.Tensor
    ddq: torch.Tensor

    @classmethod
    def of(cls, basis: JointBasis, q: Array, dq: Array, ddq: Array) -> States:
        """Return the states of motions of shape (N, n)."""
        f, g = (np.swapaxes(x, 1, 2) for x in basis.features(q))
        return cls(*(torch.from_numpy(np.array(x)) for x in (f, g, dq, ddq)))


@dataclass(frozen=True)
class Lengths:
    """Length scales: of f, shape (2, n), and of dq, shape (n,) [rad/s or m/s]."""

    f: torch.Tensor
    dq: torch.Tensor


def torque_gram(x: States, z: States, lengths: Lengths) -> torch.Tensor:
    """Covariances of torques, (N, n, M, n), for a Lagrangian of unit variance."""
    pair = _Pair.of(x, z, lengths)
    s, s_, p = pair.s[..., None], pair.s_[..., None], pair.p
    along_p = (s * s_ - pair.b[..., None]) * p - s_ * pair.a - s * (pair.a_ + pair.r_) + pair.c_
    left = torch.stack([p, pair.a - pair.r, pair.a_.expand_as(p), -pair.c], dim=-1)
    right = torch.stack([along_p, -pair.to_energy, pair.a - s * p, p], dim=-2)
    blocks = left @ right
    diagonal = (pair.b - pair.s * pair.s_)[..., None] / lengths.dq.square() + pair.m
    blocks = blocks + torch.diag_embed(diagonal)
    return (pair.k[..., None, None] * blocks).permute(0, 2, 1, 3)


def energy_gram(x: States, z: States, lengths: Lengths) -> torch.Tensor:
    """Covariances of the Lagrangian at N samples with the torques at M samples, (N, M, n)."""
    pair = _Pair.of(x, z, lengths)
    return pair.k[..., None] * pair.to_energy


@dataclass(frozen=True)
class _Pair:
    """Projections of all pairs; an underscore marks the second sample."""

    k: torch.Tensor  # (N, M)
    s: torch.Tensor  # u . zdot, (N, M)
    s_: torch.Tensor
    b: torch.Tensor  # zdot . zdot_
    p: torch.Tensor  # u . w, (N, M, n)
    r: torch.Tensor  # u . v, (N, M, n)
    r_: torch.Tensor
    a: torch.Tensor  # zdot . w, (N, 1, n)
    a_: torch.Tensor
    m: torch.Tensor  # v . v_ of the same joint, (N, M, n)
    c: torch.Tensor  # v . zdot_
    c_: torch.Tensor

    @classmethod
    def of(cls, x: States, z: States, lengths: Lengths) -> _Pair:
        velocity = lengths.dq.square()
        w_f = 1.0 / lengths.f.square()[:, None, None]
        u_f = x.f[:, :, None] - z.f[:, None]
        u_dq = x.dq[:, None] - z.dq
        g, g_ = x.g[:, :, None], z.g[:, None]
        dq, dq_ = x.dq[:, None], z.dq[None]
        p = u_dq / velocity
        r, r_ = (w_f * u_f * g).sum(0), (w_f * u_f * g_).sum(0)
        a, a_ = (x.ddq / velocity)[:, None], (z.ddq / velocity)[None]
        m = (w_f * g * g_).sum(0)
        return cls(
            k=torch.exp(-0.5 * ((w_f * u_f.square()).sum((0, 3)) + (p * u_dq).sum(2))),
            s=(r * dq).sum(2) + (u_dq * a).sum(2),
            s_=(r_ * dq_).sum(2) + (u_dq * a_).sum(2),
            b=(m * dq * dq_).sum(2) + x.ddq @ (z.ddq / velocity).T,
            p=p,
            r=r,
            r_=r_,
            a=a,
            a_=a_,
            m=m,
            c=m * dq_,
            c_=m * dq,
        )

    @property
    def to_energy(self) -> torch.Tensor:
        """Covariance of L with the second torque, in units of k, (N, M, n)."""
        return self.s_[..., None] * self.p - self.a_ - self.r_
