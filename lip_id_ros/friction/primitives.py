"""What friction terms are made of."""

from __future__ import annotations

from typing import NamedTuple


class Primitive(NamedTuple):
    """Product of a shape in motion or load, a harmonic in position, and |load| on demand."""

    shape: int  # `ONE` ... `ACCELERATION`
    width: float = 1.0  # of the smooth sign, or the step [rad/s or m/s]
    side: int = 0  # 1 or -1: only velocities of this sign; 0: both
    loaded: bool = False  # times |load|
    position: int = 0  # `ANYWHERE` ... `LEVER`
    harmonic: float = 1.0  # periods a turn; of a step 1 / width; of a lever e
    acceleration: float = 1.0  # of the sign of ddq [rad/s^2 or m/s^2]
    centre: float = 0.0  # of a step or wave [rad, m, rad/s or m/s]


ONE, VELOCITY, SIGN, SQUARE, LOAD, REVERSAL, STEP, ACCELERATION = range(8)
ANYWHERE, POSITION, COSINE, SINE, STEP_AT, LEVER = range(6)

Column = tuple[tuple[float, Primitive], ...]
"""A feature as a sum of primitives with factors."""
