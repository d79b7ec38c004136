"""JointStates as no driver should publish them, and some as it should."""

from __future__ import annotations

from collections.abc import Iterator
import math
import random

from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState

NAMES = ('shoulder', 'elbow')
OTHERS = ('', 'wrist', 'shoulder ', 'Ellbogen-β', '/', 'x' * 300)
ODD = (math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e308, -1e308)
START_S = 1_700_000_000


def joint_states(count: int, seed: int) -> Iterator[JointState]:
    """Yield the same messages for the same seed."""
    rng = random.Random(seed)
    for number in range(count):
        names = _names(rng)
        message = JointState(
            name=names,
            position=_values(rng, len(names)),
            velocity=_values(rng, len(names)),
            effort=_values(rng, len(names)),
        )
        message.header.stamp = _stamp(rng, number)
        message.header.frame_id = rng.choice(['', 'base', 'ä' * 100])
        yield message


def _names(rng: random.Random) -> list[str]:
    if rng.random() < 0.6:
        return rng.sample(NAMES, 2)
    return rng.choices(NAMES + OTHERS, k=rng.choice([0, 1, 2, 3, 50]))


def _values(rng: random.Random, n_names: int) -> list[float]:
    length = n_names if rng.random() < 0.8 else rng.choice([0, 1, 2, 3, 1000])
    odd = 0.2 if rng.random() < 0.3 else 0.0
    return [rng.choice(ODD) if rng.random() < odd else rng.gauss(0, 1) for _ in range(length)]


def _stamp(rng: random.Random, number: int) -> Time:
    kind = rng.random()
    if kind < 0.6:
        return Time(sec=START_S + number // 1000, nanosec=number % 1000 * 1_000_000)
    if kind < 0.7:
        return Time()
    if kind < 0.8:
        return Time(sec=rng.choice([-1, -(2**31), 1, 2**31 - 1]), nanosec=rng.getrandbits(32))
    return Time(sec=START_S + rng.randrange(-5, 15), nanosec=rng.randrange(10**9))
