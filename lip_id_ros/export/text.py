"""Numbers, remarks and tables as text, and the terms of friction that a format can express."""

from __future__ import annotations

from collections.abc import Collection, Iterable
import re
import textwrap
from typing import NamedTuple
import xml.etree.ElementTree as ET

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.kinematics import kinematics_of, UNIDENTIFIED
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel

ROUNDING = 1e-15
"""Below it a number is rounding of sums of numbers around one, and is written as zero."""
COLUMNS = 92


class FrictionSplit(NamedTuple):
    """Friction that a format can express, for each joint by term, and the terms left out."""

    values: tuple[dict[str, float], ...]
    left_out: FrictionModel


def number(value: float) -> str:
    """Return the shortest text that reads back as the same number."""
    if abs(value) < ROUNDING:
        return '0'
    return repr(float(value)).removesuffix('.0')


def numbers(values: Iterable[float]) -> str:
    """Return numbers with spaces between them."""
    return ' '.join(number(value) for value in np.asarray(values, dtype=np.float64))


def split_friction(arm: ArmDescription, terms: Collection[str]) -> FrictionSplit:
    """
    Divide friction into the terms that a format can express and the others.

    `terms`: names of the terms with one coefficient that it can. No format expresses terms of
    coupled joints, nor springs that push away from the middle.
    """
    values: tuple[dict[str, float], ...] = tuple({} for _ in arm.joint_names)
    left_out: list[bool] = []
    for part, coefficients in arm.friction_terms():
        single = part.drive == Drive.of_joint(part.drive.joints[0])
        expressed = single and part.term.name in terms and coefficients[0] >= 0.0
        if expressed:
            own = values[part.drive.joints[0]]
            own[part.term.name] = own.get(part.term.name, 0.0) + float(coefficients[0])
        left_out.append(not expressed)
    return FrictionSplit(values, arm.friction.with_terms(left_out))


def term_name(part: DriveTerm) -> str:
    """Return what a term of friction is called."""
    return f'coupled {part.term.name}' if len(part.drive.joints) > 1 else part.term.name


def header_lines(arm: ArmDescription, remarks: Iterable[str] = ()) -> list[str]:
    """Return what stands at the beginning of a file: remarks, and the table of the joints."""
    lines = [f'{arm.name}: inverse dynamics of an arm, identified by lip_id_ros', '']
    lines += remark_lines((*arm.remarks, *gravity_remark(arm), *remarks))
    kinematics = kinematics_of(arm.joint_names, arm.chain, arm.summary)
    marked = [] if kinematics.identified.all() else _wrapped(UNIDENTIFIED)
    return [*lines, '', *kinematics.lines(), *marked]


def remark_lines(remarks: Iterable[str]) -> list[str]:
    """Return remarks as a list of items, in lines."""
    return [line for remark in remarks for line in _wrapped(remark, '- ')]


def gravity_remark(arm: ArmDescription) -> list[str]:
    """Return a sentence on the gravity of an arm that has one."""
    if not arm.chain.gravity.any():
        return []
    return [
        f'Gravity is {numbers(np.round(arm.chain.gravity, 6))} m/s^2 in the frame of the base. '
        'Programs that begin with 9.81, such as pinocchio, make weights 3e-4 too large: set it '
        'there.'
    ]


def _wrapped(text: str, begin: str = '') -> list[str]:
    return textwrap.wrap(
        text,
        COLUMNS,
        initial_indent=begin,
        subsequent_indent=' ' * len(begin),
        break_on_hyphens=False,
        break_long_words=False,
    )


def left_out_remark(arm: ArmDescription, terms: tuple[DriveTerm, ...], name: str) -> list[str]:
    """Return a sentence on the terms of friction that a format cannot express."""
    by_term: dict[str, list[str]] = {}
    for part in terms:
        joints = ' with '.join(arm.joint_names[i] for i in part.drive.joints)
        by_term.setdefault(term_name(part), []).append(joints)
    if not by_term:
        return []
    listed = '; '.join(f'{term} ({", ".join(joints)})' for term, joints in by_term.items())
    return [f'Left out, since {name} cannot express it: {listed}.']


def roll_pitch_yaw(rotation: Array) -> Array:
    """Return the angles of R = Rot_z(yaw) Rot_y(pitch) Rot_x(roll), shape (3,) [rad]."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    # Yaw is rounding alone where the pitch is a right angle; roll makes up for it.
    rest = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ rotation
    pitch = np.arctan2(-rest[2, 0], rest[0, 0])
    return np.array([np.arctan2(-rest[1, 2], rest[1, 1]), pitch, yaw])


def xml_text(root: ET.Element, comment: Iterable[str]) -> str:
    """Return an XML document that begins with a comment."""
    ET.indent(root)
    body = ET.tostring(root, encoding='unicode')
    return f'<?xml version="1.0"?>\n{xml_comment(comment)}\n{body}\n'


def xml_comment(lines: Iterable[str]) -> str:
    """
    Return lines as a comment of XML, which two hyphens would end.

    It has no colon before a blank: ROS reads the text of a parameter `robot_description` as YAML.
    """
    plain = (re.sub(r':(?=\s|$)', ' -', re.sub('-(?=-)', '- ', line)) for line in lines)
    text = '\n'.join(f'  {line}'.rstrip() for line in plain)
    return f'<!--\n{text}\n-->'
