"""What friction terms are made of, for compiled evaluation."""

from __future__ import annotations

from typing import NamedTuple


class Primitive(NamedTuple):
    """
    Product of a shape in the motion or the load, a harmonic in position, and the load on demand.

    Attributes
    ----------
    shape : int
        One of `ONE`, `VELOCITY`, `SIGN`, `SQUARE`, `LOAD`, `REVERSAL`, `STEP`.
    width : float
        Of the smooth sign, or of the step in velocity [rad/s or m/s].
    side : int
        1 or -1: zero where the velocity has the other sign; 0 for both.
    loaded : bool
        Times |load|.
    position : int
        One of `ANYWHERE`, `POSITION`, `COSINE`, `SINE`, `STEP_AT`, `LEVER`.
    harmonic : float
        Number of periods a turn; of a step in position 1 / width [1/rad or 1/m]; of a lever its
        eccentricity.
    acceleration : float
        Width of the smooth sign of the acceleration [rad/s^2 or m/s^2].
    centre : float
        Where a step or a wave is [rad, m, rad/s or m/s].

    """

    shape: int
    width: float = 1.0
    side: int = 0
    loaded: bool = False
    position: int = 0
    harmonic: float = 1.0
    acceleration: float = 1.0
    centre: float = 0.0


ONE, VELOCITY, SIGN, SQUARE, LOAD, REVERSAL, STEP = range(7)
ANYWHERE, POSITION, COSINE, SINE, STEP_AT, LEVER = range(6)

Column = tuple[tuple[float, Primitive], ...]
"""A feature as a sum of primitives with factors, for compiled evaluation."""
