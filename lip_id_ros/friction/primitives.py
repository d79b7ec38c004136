"""What friction terms are made of, for compiled evaluation."""

from __future__ import annotations

from typing import NamedTuple


class Primitive(NamedTuple):
    """
    Product of a shape in velocity or load, a harmonic in position, and the load where asked for.

    Attributes
    ----------
    shape : int
        One of `ONE`, `VELOCITY`, `SIGN`, `SQUARE`, `LOAD`.
    width : float
        Of the smooth sign [rad/s or m/s].
    side : int
        1 or -1: zero where the velocity has the other sign; 0 for both.
    loaded : bool
        Times |load|.
    position : int
        One of `ANYWHERE`, `POSITION`, `COSINE`, `SINE`.
    harmonic : float
        Number of periods a turn.

    """

    shape: int
    width: float = 1.0
    side: int = 0
    loaded: bool = False
    position: int = 0
    harmonic: float = 1.0


ONE, VELOCITY, SIGN, SQUARE, LOAD = range(5)
ANYWHERE, POSITION, COSINE, SINE = range(4)

Column = tuple[tuple[float, Primitive], ...]
"""A feature as a sum of primitives with factors, for compiled evaluation."""
