"""The reference of the paper's tracking experiment."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array

RATE = np.pi  # rad/s


@dataclass(frozen=True)
class GrowingCosine:
    r"""
    Every joint swings around a posture, ever further (paper, eq. `ref_ctrl`).

    .. math:: q_i(t) = \bar q_i + \frac{A}{T} t \cos(\pi t)

    The paper's equation has no posture; with a Panda's fourth joint, which cannot reach zero, it
    needs one.

    Attributes
    ----------
    centre : ndarray, shape (n,)
        The posture [rad or m].
    amplitude : float
        Reached at the horizon [rad or m].
    horizon : float
        T [s].

    """

    centre: Array
    amplitude: float
    horizon: float

    def sample(self, t: float | Array) -> tuple[Array, Array, Array]:
        """
        Exact motion at one or many times.

        Parameters
        ----------
        t : float, or ndarray of shape (N,)
            [s].

        Returns
        -------
        q, dq, ddq : ndarray, shape (n,) or (N, n)

        """
        time = np.asarray(t, dtype=np.float64)[..., np.newaxis]
        slope = self.amplitude / self.horizon * np.ones_like(self.centre)
        sin, cos = np.sin(RATE * time), np.cos(RATE * time)
        q = self.centre + slope * time * cos
        dq = slope * (cos - RATE * time * sin)
        ddq = -slope * RATE * (2 * sin + RATE * time * cos)
        return q, dq, ddq
