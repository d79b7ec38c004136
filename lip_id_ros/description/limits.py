"""Limits of joints that a URDF has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import xml.etree.ElementTree as ET

import numpy as np

from lip_id_ros.description.urdf import LARGEST, parsed, sane
from lip_id_ros.errors import DataError

ANY_TURN = np.pi
"""A joint without limits of position may turn as far to each side [rad]."""


@dataclass(frozen=True)
class JointRanges:
    """
    Limits of the joints of an arm, one number each; nan where a URDF has none.

    `lower`, `upper` [rad or m], `velocity` [rad/s or m/s], `effort` [N m or N].
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    velocity: tuple[float, ...]
    effort: tuple[float, ...]


def joint_ranges(text: str, place: str, joint_names: Sequence[str]) -> JointRanges:
    """
    Return the `<limit>` of each joint of a URDF.

    DataError if it is no URDF, lacks a joint, or has a limit that is no number. Zeros of velocity
    or effort count as none: converters write them where they know none.
    """
    joints = parsed(text, place).findall('joint')
    rows = [_ranges(_joint(joints, name, place, 'limits'), place) for name in joint_names]
    return JointRanges(*zip(*rows, strict=True))


def _ranges(joint: ET.Element, place: str) -> tuple[float, float, float, float]:
    if joint.get('type') == 'continuous':
        low, high = -ANY_TURN, ANY_TURN
    else:
        low, high = (_number(joint, name, place) for name in ('lower', 'upper'))
    velocity, effort = (_number(joint, name, place) for name in ('velocity', 'effort'))
    return low, high, velocity or np.nan, effort or np.nan


def _number(joint: ET.Element, name: str, place: str) -> float:
    limit = joint.find('limit')
    if limit is None:
        return np.nan
    # http://wiki.ros.org/urdf/XML/joint: positions default to 0
    word = limit.get(name, '0')
    value = sane(word)
    if np.isnan(value):
        raise DataError(
            f'<limit {name}="..."> of joint {joint.get("name")!r} in {place} was expected to be a '
            f'number of at most {LARGEST:g}, but is {word!r}; correct the URDF.'
        )
    return value


def effort_limits(text: str, place: str, joint_names: Sequence[str]) -> tuple[float, ...]:
    """
    Return the largest effort of each joint by the `<limit>` of a URDF [N m or N].

    `place` is where the text comes from, for messages.

    DataError if it is no URDF, lacks a joint or its limit, or has one that is no torque of an arm:
    zero is what converters write where they know none.
    """
    joints = parsed(text, place).findall('joint')
    return tuple(_effort_limit(joints, name, place) for name in joint_names)


def _effort_limit(joints: Sequence[ET.Element], name: str, place: str) -> float:
    limit = _joint(joints, name, place, 'torque_limits').find('limit')
    word = None if limit is None else limit.get('effort')
    value = sane(word or '')
    if not value > 0.0:
        has = 'none' if word is None else repr(word)
        raise DataError(
            f'<limit effort="..."> of joint {name!r} in {place} was expected to be above 0 and at '
            f'most {LARGEST:g}, but is {has}; correct the URDF, or give torque_limits in numbers.'
        )
    return value


def _joint(joints: Sequence[ET.Element], name: str, place: str, setting: str) -> ET.Element:
    found = [joint for joint in joints if joint.get('name') == name]
    if len(found) != 1:
        raise DataError(
            f'{place} was expected to have the joint {name!r} once, but has it {len(found)} '
            f'times; give the URDF of this arm, or {setting} in numbers.'
        )
    return found[0]
