"""Limits on efforts that a URDF has."""

from __future__ import annotations

from collections.abc import Sequence
import xml.etree.ElementTree as ET

import numpy as np

from lip_id_ros.description.urdf import LARGEST, parsed
from lip_id_ros.errors import DataError


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
    found = [joint for joint in joints if joint.get('name') == name]
    if len(found) != 1:
        raise DataError(
            f'{place} was expected to have the joint {name!r} once, but has it {len(found)} '
            'times; publish the URDF of this arm, or give torque_limits in numbers.'
        )
    limit = found[0].find('limit')
    word = None if limit is None else limit.get('effort')
    try:
        value = float(word or 'nan')
    except ValueError:
        value = np.nan
    if not 0.0 < value <= LARGEST:
        has = 'none' if word is None else repr(word)
        raise DataError(
            f'<limit effort="..."> of joint {name!r} in {place} was expected to be above 0 and at '
            f'most {LARGEST:g}, but is {has}; correct the URDF, or give torque_limits in numbers.'
        )
    return value
