"""
The arm that a URDF describes (http://wiki.ros.org/urdf/XML).

The joints of the data are the joints of the arm. All other joints of the file are locked at zero,
so that what hangs on them belongs to the link that carries it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import os
from pathlib import Path
import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.description import is_text
from lip_id_ros.description.robot import Body, moved, RobotDescription, rotation_to, transform
from lip_id_ros.errors import DataError
from lip_id_ros.files import path_text, require_regular_file
from lip_id_ros.joint_types import is_prismatic, PRISMATIC, REVOLUTE
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS, STANDARD_GRAVITY

MOST_BYTES = 2**26

LARGEST = 1e6
"""No length, mass, inertia or coefficient of an arm is larger, in SI units."""

LONGEST = 20.0
"""No joint is farther from the one before it, and no centre of mass from its joint [m]."""

LEAST_AXIS = 1e-6
"""A shorter vector has no direction."""

KINDS = {REVOLUTE: REVOLUTE, 'continuous': REVOLUTE, PRISMATIC: PRISMATIC}


def load_description(
    source: str | os.PathLike[str], joint_names: Sequence[str], joint_types: Sequence[str]
) -> RobotDescription:
    """
    Read a URDF from a file, or from its text as a `robot_description` topic has it.

    `source`: a text that begins with `<` is the URDF itself. `joint_names`, `joint_types`: of the
    arm, from base to tip. OSError if it cannot be opened; SourceError if it is not a regular file;
    DataError if it is no URDF, or not of this arm.
    """
    return parse_description(*urdf_text(source), joint_names, joint_types)


def urdf_text(source: str | os.PathLike[str]) -> tuple[str, str]:
    """Return the text of a URDF, and where it comes from; raises what `load_description` does."""
    text = path_text(source)
    if is_text(text):
        return text, 'robot_description'
    require_regular_file(source)
    if os.path.getsize(source) > MOST_BYTES:
        raise DataError(f'{text} is not a URDF: it has more than {MOST_BYTES} bytes.')
    try:
        return Path(source).read_bytes().decode(), text  # keeps the ends of lines
    except UnicodeDecodeError as error:
        raise DataError(f'{text} is not a URDF in UTF-8 ({error}); give another file.') from error


def parse_description(
    text: str, place: str, joint_names: Sequence[str], joint_types: Sequence[str]
) -> RobotDescription:
    """
    Read the text of a URDF.

    `place`: where it comes from, for messages. DataError if it is no URDF, or not of this arm.
    """
    reader = _Reader(parsed(text, place), place)
    description = reader.description(text.lstrip(), joint_names, joint_types)
    _require_metres(description)
    return description


def moving_joints(text: str, place: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """
    Return names and types of the joints of a URDF that move by themselves, from the base on.

    `place`: where it comes from, for messages. DataError if it is no URDF.
    """
    return _Reader(parsed(text, place), place).moving_joints()


def _require_metres(description: RobotDescription) -> None:
    moments, masses = description.links[:, 1:4], description.links[:, :1]
    centres = np.divide(moments, masses, out=np.zeros_like(moments), where=masses > 0.0)
    lengths = np.zeros(len(centres))
    # how far the first joint is from the root of the file says nothing about the arm
    lengths[1:] = np.linalg.norm(description.chain.translations[1:], axis=1)
    lengths = np.maximum(lengths, np.linalg.norm(centres, axis=1))
    worst = int(lengths.argmax())
    if lengths[worst] > LONGEST:
        raise DataError(
            f'lengths in {description.place} were expected in metres, but joint '
            f'{description.joint_names[worst]!r} has one of {lengths[worst]:.4g} m; write '
            'millimetres as metres.'
        )


def sane(word: str) -> float:
    """Return the number that a word of a URDF is; nan where it is none, or beyond `LARGEST`."""
    try:
        value = float(word)
    except ValueError:
        return np.nan
    return value if abs(value) <= LARGEST else np.nan


def parsed(text: str, place: str) -> ET.Element:
    """
    Return the `<robot>` element of a URDF.

    DataError if there is none, or the text is the source of a xacro.
    """
    if '<!DOCTYPE' in text or '<!ENTITY' in text:
        raise DataError(f'{place} has a document type, which no URDF needs; remove it.')
    try:
        root = ET.fromstring(text.lstrip())
    except (ET.ParseError, ValueError) as error:
        _refuse_xacro('<xacro:' in text, place)
        raise DataError(f'{place} is not a URDF ({error}); give another file.') from error
    _refuse_xacro(any(map(_is_xacro, root.iter())), place)
    if root.tag != 'robot':
        raise DataError(f'{place} is not a URDF: <robot> was expected, but <{root.tag}> came.')
    return root


def _is_xacro(element: ET.Element) -> bool:
    values = (*element.attrib.values(), element.text or '')
    return 'xacro' in str(element.tag) or any('${' in x or '$(' in x for x in values)


def _refuse_xacro(found: bool, place: str) -> None:
    if found:
        raise DataError(
            f'{place} is the source of a xacro, but a URDF was expected; write it with '
            f'`xacro {place} > arm.urdf` and give that.'
        )


class _Reader:
    """Looks things up in a `<robot>` element."""

    def __init__(self, root: ET.Element, place: str) -> None:
        self._place = place
        self._links = {link.get('name', ''): link for link in root.findall('link')}
        self._joints = {joint.get('name', ''): joint for joint in root.findall('joint')}
        self._above: dict[str, ET.Element] = {}
        self._below: dict[str, list[ET.Element]] = {}
        for joint in self._joints.values():
            child = self._end(joint, 'child')
            if child in self._above:
                raise DataError(
                    f'link {child!r} in {place} hangs on two joints; a tree was expected.'
                )
            self._above[child] = joint
            self._below.setdefault(self._end(joint, 'parent'), []).append(joint)

    def description(
        self, text: str, names: Sequence[str], types: Sequence[str]
    ) -> RobotDescription:
        """Return the arm whose joints have given names."""
        joints = [self._joint(name, kind) for name, kind in zip(names, types, strict=True)]
        to_axis = np.array([rotation_to(self._axis(joint)) for joint in joints])
        before = np.empty((len(joints), 4, 4))
        placements = np.empty_like(before)
        carrier, turned = None, np.eye(4)
        for i, joint in enumerate(joints):
            before[i] = turned @ self._fixed(joint, carrier)
            turned = transform(to_axis[i].T, np.zeros(3))
            placements[i] = before[i] @ self._origin(joint) @ turned.T
            carrier = joint
        return RobotDescription(
            place=self._place,
            text=text,
            joint_names=tuple(names),
            joint_types=tuple(types),
            chain=Chain(
                np.ascontiguousarray(placements[:, :3, :3]),
                np.ascontiguousarray(placements[:, :3, 3]),
                is_prismatic(types),
                np.array([0.0, 0.0, -STANDARD_GRAVITY]),
            ),
            bodies=tuple(
                tuple(
                    self._bodies(self._end(joint, 'child'), transform(turn.T, np.zeros(3)), names)
                )
                for joint, turn in zip(joints, to_axis, strict=True)
            ),
            damping=np.array([self._dynamics(joint, 'damping') for joint in joints]),
            friction=np.array([self._dynamics(joint, 'friction') for joint in joints]),
            to_axis=to_axis,
            before=before,
        )

    def moving_joints(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return names and types of the joints that move by themselves, from the base on."""
        waiting = [link for link in self._below if link not in self._above]
        found: dict[str, str] = {}
        while waiting:
            for joint in self._below.get(waiting.pop(0), []):
                if joint.get('type') in KINDS and joint.find('mimic') is None:
                    found[joint.get('name', '')] = KINDS[joint.get('type', '')]
                waiting.append(self._end(joint, 'child'))
        return tuple(found), tuple(found.values())

    def _joint(self, name: str, kind: str) -> ET.Element:
        movable = [x for x, joint in self._joints.items() if joint.get('type') in KINDS]
        if name not in movable:
            raise DataError(
                f'joint {name!r} of the data is not among the joints that move in {self._place}, '
                f'which are {", ".join(movable) or "none"}; give the URDF of this arm, or name '
                'the joints as it does.'
            )
        found = KINDS[self._joints[name].get('type', '')]
        if found != kind:
            raise DataError(
                f'joint {name!r} is {found} in {self._place}, but {kind} in the data; set '
                'recording.joint_types, or give the URDF of this arm.'
            )
        return self._joints[name]

    def _fixed(self, joint: ET.Element, carrier: ET.Element | None) -> Array:
        """Return the placement of a joint's parent link in the link of the joint before."""
        end = None if carrier is None else self._end(carrier, 'child')
        link, out, seen = self._end(joint, 'parent'), np.eye(4), set()
        while link != end and link in self._above and link not in seen:
            seen.add(link)
            out = self._origin(self._above[link]) @ out
            link = self._end(self._above[link], 'parent')
        if end not in (link, None) or link in seen:
            below = 'the base' if carrier is None else f'joint {carrier.get("name")!r}'
            raise DataError(
                f'joint {joint.get("name")!r} was expected to be carried by {below} in '
                f'{self._place}, but it is not; name the joints of one serial arm from base to '
                'tip.'
            )
        return out

    def _bodies(self, link: str, placement: Array, names: Sequence[str]) -> Iterator[Body]:
        """Yield a link and what it carries, but for what the joints of the arm move."""
        waiting = [(link, placement)]
        while waiting:
            link, placement = waiting.pop(0)
            yield Body(link, placement, self._inertial(link))
            for joint in self._below.get(link, []):
                if joint.get('name') not in names:
                    self._refuse_mimic(joint, names)
                    child = self._end(joint, 'child')
                    waiting.append((child, placement @ self._origin(joint)))

    def _refuse_mimic(self, joint: ET.Element, names: Sequence[str]) -> None:
        mimic = joint.find('mimic')
        if mimic is not None and mimic.get('joint') in names:
            name, leader = joint.get('name'), mimic.get('joint')
            raise DataError(
                f'joint {name!r} in {self._place} moves with joint {leader!r} of the arm by '
                '<mimic>, which the links of a serial arm cannot; fit without the URDF, or make '
                'it a fixed joint.'
            )

    def _inertial(self, link: str) -> Array:
        element = self._links.get(link)
        inertial = None if element is None else element.find('inertial')
        if inertial is None:
            return np.zeros(LINK_PARAMETERS - 1)
        what = f'the inertial of link {link!r}'
        mass = self._number(inertial.find('mass'), 'value', what)
        if mass < 0.0:
            raise DataError(f'value of {what} in {self._place} was expected to be a mass of zero '
                            f'or more, not {mass:g}.')  # fmt: skip
        entries = inertial.find('inertia')
        names = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
        inertia = [self._number(entries, name, what) for name in names]
        about_centre = np.array([mass, 0.0, 0.0, 0.0, *inertia])
        return moved(about_centre, self._origin(inertial))

    def _dynamics(self, joint: ET.Element, name: str) -> float:
        element = joint.find('dynamics')
        return self._number(element, name, f'<dynamics> of {joint.get("name")!r}')

    def _axis(self, joint: ET.Element) -> Array:
        axis = joint.find('axis')
        found = self._three(axis, 'xyz', np.array([1.0, 0.0, 0.0]), joint)
        size = np.linalg.norm(found)
        if size < LEAST_AXIS:
            name = joint.get('name')
            raise DataError(f'the axis of joint {name!r} in {self._place} has no direction.')
        return np.asarray(found / size)

    def _origin(self, element: ET.Element) -> Array:
        origin = element.find('origin')
        xyz = self._three(origin, 'xyz', np.zeros(3), element)
        rpy = self._three(origin, 'rpy', np.zeros(3), element)
        return transform(Rotation.from_euler('xyz', rpy).as_matrix(), xyz)

    def _three(
        self, element: ET.Element | None, name: str, default: Array, owner: ET.Element
    ) -> Array:
        if element is None or name not in element.attrib:
            return default
        what = f'{name} of {owner.get("name") or owner.tag!r}'
        numbers = [self._float(word, what) for word in element.attrib[name].split()]
        if len(numbers) != 3:
            raise DataError(
                f'{what} in {self._place} needs three numbers, but has {len(numbers)}.'
            )
        return np.array(numbers)

    def _number(self, element: ET.Element | None, name: str, what: str) -> float:
        return 0.0 if element is None else self._float(element.get(name, '0'), f'{name} of {what}')

    def _float(self, word: str, what: str) -> float:
        value = sane(word)
        if np.isnan(value):
            raise DataError(
                f'{what} in {self._place} was expected to be a number of at most {LARGEST:g}, not '
                f'{word!r}.'
            )
        return value

    def _end(self, joint: ET.Element, which: str) -> str:
        end = joint.find(which)
        if end is None or end.get('link') is None:
            name = joint.get('name')
            raise DataError(f'joint {name!r} in {self._place} has no <{which} link="...">.')
        return end.attrib['link']
