"""The beginning of a serialised JointTrajectory: its stamp and the number of its points."""

from __future__ import annotations

import struct
from typing import NamedTuple

from lip_id_ros.signals.joint_states import NANOSECONDS
from lip_id_ros.signals.joints import Refusal, RefusedError

ENCAPSULATION = 4
COUNT, STAMP = struct.calcsize('I'), struct.calcsize('iI')

MOST_NAMES = 1000
"""More joints than any robot has: a million names take a second to read."""


class TrajectoryHeader(NamedTuple):
    """What is before the points."""

    stamp_ns: int  # [ns]
    n_points: int


def read_header(raw: bytes) -> TrajectoryHeader:
    """
    Read stamp and number of points of CDR bytes, without the points.

    RefusedError if it ends before, names more than `MOST_NAMES` joints, or a name is no text.
    """
    order = '<' if raw[1:2] == b'\x01' else '>'
    body = memoryview(raw)[ENCAPSULATION:]

    def number(at: int) -> int:
        return int(struct.unpack_from(f'{order}I', body, at)[0])

    def after_string(at: int) -> int:
        return _aligned(at + COUNT + number(at))

    try:
        sec, nanosec = struct.unpack_from(f'{order}iI', body)
        at = after_string(STAMP)
        n_names, at = number(at), at + COUNT
        if n_names > MOST_NAMES:
            raise RefusedError(Refusal.TOO_MANY_NAMES)
        for _ in range(n_names):
            bytes(body[at + COUNT : at + COUNT + number(at)]).decode()
            at = after_string(at)
        return TrajectoryHeader(NANOSECONDS * sec + nanosec, number(at))
    except (struct.error, UnicodeDecodeError):
        raise RefusedError(Refusal.MALFORMED) from None


def _aligned(at: int) -> int:
    return (at + 3) & ~3
