"""What a single state of the joints does not show of their past, as far as it is known."""

from __future__ import annotations

from typing import NamedTuple

from lip_id_ros.arrays import Array

DISPLACEMENTS = (3e-4, 1e-3, 3e-3, 0.01, 0.03)
"""Displacements within which friction turns, of the states that are kept [rad or m]."""


class JointHistory(NamedTuple):
    """
    History of N samples of n joints; None for what is not known.

    Attributes
    ----------
    sign : array, shape (N, n)
        Signs of the velocities after the low-pass that the torques went through.
    dahl : array, shape (N, n, D)
        States of Dahl's friction for each of `DISPLACEMENTS`.

    """

    sign: Array | None = None
    dahl: Array | None = None


UNKNOWN = JointHistory()
"""The history of single states."""
