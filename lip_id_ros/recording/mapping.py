"""Joints of a message to the joints that are wanted: the one place, for bags and live nodes."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from lip_id_ros.arrays import IndexArray

LARGEST = 1e9
"""No joint has a position, velocity or effort beyond this in any unit; it is noise in memory."""


class Reason(StrEnum):
    """Why a message was dropped."""

    NO_NAMES = 'no joint names'
    REPEATED_NAME = 'joint name repeated'
    FOREIGN_JOINTS = 'only foreign joints'
    MISSING_JOINT = 'joint missing'
    NO_POSITION = 'position empty'
    POSITION_LENGTH = 'position not as long as names'
    VELOCITY_LENGTH = 'velocity not as long as names'
    EFFORT_LENGTH = 'effort not as long as names'
    NOT_FINITE = 'value not finite'
    ABSURD = 'value absurdly large'
    BAD_STAMP = 'stamp negative or not finite'
    ZERO_STAMP = 'stamp zero'
    BACKWARD_STAMP = 'stamp went back'
    FAR_STAMP = 'stamp far ahead'
    STRAY_STAMP = 'stamp far from its neighbours'
    REPEATED_STAMP = 'stamp repeated'
    BUFFER_FULL = 'buffer full'
    NO_VELOCITY = 'velocity empty where others have it'
    NO_EFFORT = 'effort empty where others have it'
    OTHER_JOINTS_AWAY = 'other joints not known at that time'
    UNREADABLE = 'message unreadable'
    LOST = 'in a damaged part of the file'


def name_reason(names: Sequence[str]) -> Reason | None:
    """Say what is wrong with the names of a message, whatever joints are wanted."""
    if not names:
        return Reason.NO_NAMES
    return Reason.REPEATED_NAME if len(set(names)) != len(names) else None


def length_reason(names: int, position: int, velocity: int, effort: int) -> Reason | None:
    """Say what is wrong with the lengths of a message's arrays."""
    if position == names and velocity in (0, names) and effort in (0, names):
        return None
    if position == 0:
        return Reason.NO_POSITION
    if position != names:
        return Reason.POSITION_LENGTH
    return Reason.VELOCITY_LENGTH if velocity not in (0, names) else Reason.EFFORT_LENGTH


def columns_of(names: Sequence[str], joints: Sequence[str]) -> IndexArray:
    """Return where in a message the joints are that it has, in the order of `joints`."""
    place = {name: column for column, name in enumerate(names)}
    return np.array([place[joint] for joint in joints if joint in place], np.intp)
