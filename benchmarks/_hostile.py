"""Messages as no driver and no planner should publish them, and some as they should."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
import math
import time
from typing import Any

from builtin_interfaces.msg import Duration, Time
from control_msgs.msg import JointTrajectoryControllerState
import numpy as np
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

OTHERS = ('', 'c', 'a ', 'ä' * 100, '/')
ODD = (math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, 1e308, -1e300, 1e12)
START_S = 1_700_000_000
POINTS, SHARES = (0, 1, 2, 3, 40, 2000), (0.1, 0.6, 0.1, 0.1, 0.095, 0.005)
USES: Mapping[str, tuple[str, ...]] = {
    'serve': (),
    'train': ('rows',),
    'monitor': ('watched', 'too_soon', 'after_a_gap'),
    'adapt': (
        *('too_soon', 'after_a_gap', 'out_of_range', 'waiting'),
        *('learned', 'held', 'disturbed', 'resting', 'settling', 'stuck'),
    ),
}
"""The counters of ~/status for the messages that a node used."""


def counts(name: str, status: Mapping[str, Any]) -> tuple[int, int]:
    """
    Return how many messages a node received, by its own counter, and how many it accounts for.

    Parameters
    ----------
    name : str
        Of the node.
    status : mapping
        Its ~/status.

    """
    received = status['received']
    used = {key: n for key, n in status.items() if key in USES[name]}
    if name == 'serve':
        received = sum(received.values())
        used = {**status['answered'], **status['unmeasured']}
    refused = status['rejected' if name == 'train' else 'refused']
    return received, sum(used.values()) + sum(refused.values())


def hostile_states(rng: np.random.Generator, names: Sequence[str]) -> Iterator[JointState]:
    """Yield joint states as no driver should publish them, and some as it should."""
    number = 0
    while True:
        number += 1
        some = _names(rng, names)
        message = JointState(
            name=some,
            position=_values(rng, len(some)),
            velocity=_values(rng, len(some)),
            effort=_values(rng, len(some)),
        )
        message.header.stamp = _stamp(rng, number)
        yield message


def hostile_trajectory(rng: np.random.Generator, names: Sequence[str]) -> JointTrajectory | bytes:
    """Return a reference or a plan, usually with something wrong; sometimes damaged bytes."""
    some = _names(rng, names)
    trajectory = JointTrajectory(joint_names=some)
    trajectory.header.stamp = _sent_stamp(rng)
    n_points = int(rng.choice(POINTS, p=SHARES))
    trajectory.points = [
        JointTrajectoryPoint(
            positions=_values(rng, len(some)),
            velocities=_values(rng, len(some)),
            accelerations=_values(rng, len(some)),
            effort=_values(rng, len(some)) if rng.random() < 0.3 else [],
            time_from_start=_time(rng, row),
        )
        for row in range(n_points)
    ]
    return damaged(rng, trajectory) if rng.random() < 0.05 else trajectory


def _names(rng: np.random.Generator, names: Sequence[str]) -> list[str]:
    if rng.random() < 0.7:
        return [str(name) for name in rng.permutation(names)]
    count = int(rng.choice([0, 1, 2, 3, 50]))
    return [str(name) for name in rng.choice([*names, *OTHERS], size=count)]


def _values(rng: np.random.Generator, n_names: int) -> list[float]:
    length = n_names if rng.random() < 0.9 else int(rng.choice([0, 1, 2, 3, 1000]))
    values = rng.normal(size=length)
    if rng.random() < 0.1 and length:
        values[rng.integers(length)] = rng.choice(ODD)
    return [float(value) for value in values]


def _time(rng: np.random.Generator, row: int) -> Duration:
    if rng.random() < 0.05:
        return Duration(sec=int(rng.choice([-(2**31), -1, 0, 2**31 - 1])))
    return Duration(sec=row)


def _stamp(rng: np.random.Generator, number: int) -> Time:
    kind = rng.random()
    if kind < 0.7:
        return Time(sec=START_S + number // 100, nanosec=number % 100 * 10_000_000)
    if kind < 0.8:
        return Time()
    if kind < 0.9:
        return Time(sec=int(rng.choice([-1, -(2**31), 1, 2**31 - 1])))
    return Time(sec=START_S + number // 100 + int(rng.integers(-5, 15)))


def hostile_controller_state(
    rng: np.random.Generator, names: Sequence[str]
) -> JointTrajectoryControllerState:
    """Return a state of a controller at any speed, usually with something wrong."""
    some = _names(rng, names)
    reference = JointTrajectoryPoint(
        positions=_values(rng, len(some)),
        velocities=_values(rng, len(some)),
        accelerations=_values(rng, len(some)),
    )
    state = JointTrajectoryControllerState(joint_names=some, reference=reference)
    state.header.stamp = _sent_stamp(rng)
    state.speed_scaling_factor = float(rng.choice([1.0, 1.0, 0.3, 0.0, *ODD]))
    return state


def _sent_stamp(rng: np.random.Generator) -> Time:
    """Return the present time, none, an absurd one, or that of a clock up to an hour away."""
    kind = rng.random()
    if kind < 0.1:
        return Time()
    if kind < 0.15:
        return Time(sec=int(rng.choice([-1, -(2**31), 1, 2**31 - 1])))
    away_s = 0.0 if kind < 0.8 else rng.choice([0.4, 10.5, 3600.0]) * rng.choice([-1.0, 1.0])
    sec, nanosec = divmod(time.time_ns() + round(1e9 * away_s), 10**9)
    return Time(sec=sec, nanosec=nanosec)


def damaged(rng: np.random.Generator, message: Any) -> bytes:
    """Return the bytes of a message with some of them changed, or cut short."""
    raw = bytearray(serialize_message(message))
    for _ in range(int(rng.integers(1, 4))):
        raw[int(rng.integers(4, len(raw)))] = int(rng.integers(256))
    return bytes(raw[: int(rng.integers(8, len(raw) + 1))])
