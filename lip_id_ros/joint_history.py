"""What a single state of the joints does not show of their past, as far as it is known."""

from __future__ import annotations

from typing import NamedTuple

from lip_id_ros.arrays import Array

DISPLACEMENTS = (3e-4, 1e-3, 3e-3, 0.01, 0.03)
"""Displacements within which friction turns, of the states that are kept [rad or m]."""


class JointHistory(NamedTuple):
    """History of N samples of n joints; None for what is not known."""

    sign: Array | None = None  # (N, n), of velocities after the low-pass of the torques
    dahl: Array | None = None  # (N, n, D), states of Dahl's friction by `DISPLACEMENTS`


UNKNOWN = JointHistory()
"""The history of single states."""
