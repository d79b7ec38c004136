"""
Joint features.

The functions of one joint's position that the factors are made of. A factor is a(q, q') = w_0 +
w_1 f_1(q) f_1(q') + w_2 f_2(q) f_2(q'), where (f_1, f_2) is (cos q, sin q) or, prismatic, (u, 0)
with u in half training ranges from their centre (paper, section `subsec:prior_functions`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import ShapeError
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.numba_jit import LANES


class PackedStates(NamedTuple):
    """
    Joint states laid out for the fused loops: sample last, padded with zeros by `LANES` samples.

    `f` and `g`, shape (2, n, N + LANES), are features and their derivatives by the position; `dq`
    and `ddq` have shape (n, N + LANES).
    """

    f: Array
    g: Array
    dq: Array
    ddq: Array


@dataclass(frozen=True)
class JointBasis:
    """
    The features of every joint of an arm, from base to tip.

    `centre` and `half_range`, shape (n,), are those of the training positions; used for prismatic
    joints only.
    """

    joint_types: tuple[str, ...]
    centre: Array
    half_range: Array

    @classmethod
    def of(cls, joint_types: tuple[str, ...], q: Array) -> JointBasis:
        """Take the ranges from training positions q, shape (N, n) [rad or m]."""
        low, high = q.min(axis=0), q.max(axis=0)
        half = 0.5 * (high - low)
        return cls(joint_types, 0.5 * (low + high), np.where(half > 0.0, half, 1.0))

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.joint_types)

    @property
    def prismatic(self) -> BoolArray:
        """Which joints are prismatic, shape (n,)."""
        return is_prismatic(self.joint_types)

    def features(self, q: Array) -> tuple[Array, Array]:
        """Return the features and their derivatives, (2, n, N) each, at positions (N, n)."""
        cos, sin = np.cos(q).T, np.sin(q).T
        u = ((q - self.centre) / self.half_range).T
        slope = np.broadcast_to(1.0 / self.half_range[:, None], u.shape)
        none = np.zeros_like(u)
        pick = self.prismatic[:, None]
        f = np.stack([np.where(pick, u, cos), np.where(pick, none, sin)])
        g = np.stack([np.where(pick, slope, -sin), np.where(pick, none, cos)])
        return f, g

    def pack(self, q: Array, dq: Array, ddq: Array) -> PackedStates:
        """Lay joint states out for the fused loops; ShapeError unless all are (N, n)."""
        for name, x in (('q', q), ('dq', dq), ('ddq', ddq)):
            if x.ndim != 2 or x.shape != q.shape or x.shape[1] != self.n_joints:
                raise ShapeError(
                    f'{name} must have shape (N, {self.n_joints}) as all joint states, '
                    f'but has shape {x.shape}; pass one row per sample and one column per joint.'
                )
        f, g = self.features(q)
        return PackedStates(_pad(f), _pad(g), _pad(dq.T), _pad(ddq.T))


def _pad(x: Array) -> Array:
    widths = [(0, 0)] * (x.ndim - 1) + [(0, LANES)]
    return np.ascontiguousarray(np.pad(x, widths), dtype=np.float64)
