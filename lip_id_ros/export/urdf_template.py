"""
What was fitted, written back into the URDF that the fit started from.

Inertials, damping and friction are replaced, and the origins of the joints where that is asked
for, and a comment at the end names the file as ours; every other byte of the file stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import re
from typing import NamedTuple
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.description.robot import Body, moved, RobotDescription, transform
from lip_id_ros.errors import ModelError
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.text import (
    gravity_remark,
    left_out_remark,
    number,
    numbers,
    remark_lines,
    roll_pitch_yaw,
    split_friction,
    xml_comment,
)
from lip_id_ros.export.urdf import centre_of_mass_inertia, FRICTION, INERTIAS
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.pseudo_inertia import pseudo_inertia

HALVINGS = 20
"""Of the inertials of what is fixed to a link, where more than the whole was identified."""

LEAST_TURN, LEAST_SHIFT = 1e-6, 1e-9
"""Differences of origins that are rounding [degrees, m]."""

NOTE = 'inertials, damping and friction, identified by lip_id_ros'
LAST_NOTE = re.compile(rf'\n*<!--\n  [^\n]*{NOTE}\n((?!-->).)*-->\n*\Z', re.DOTALL)
"""At the end of a text that was filled before."""

ATTRIBUTE = r'\s{}\s*=\s*("[^"]*"|\'[^\']*\')'


def require_same_frames(model: InverseDynamicsModel, description: RobotDescription) -> None:
    """Raise ModelError where a model was not fitted with this description's joints."""
    known = model.summary.get('description', {}).get('fingerprint')
    if known != description.fingerprint:
        found = 'with another one' if known else 'without one'
        raise ModelError(
            f'a model that was fitted with {description.place} was expected, but this one was '
            f'fitted {found}; fit again with --urdf {description.place}.'
        )


def noted_template(arm: ArmDescription, description: RobotDescription, origins: bool) -> str:
    """Return a filled template that ends with a comment on what it lacks."""
    filled = LAST_NOTE.sub('', fill_template(arm, description, origins)).rstrip('\n')
    left_out = left_out_remark(arm, split_friction(arm, FRICTION).left_out.basis.terms, 'URDF')
    remarks = remark_lines([*gravity_remark(arm), *left_out])
    return f'{filled}\n{xml_comment([f"{arm.name}: {NOTE}", *remarks])}\n'


def fill_template(arm: ArmDescription, description: RobotDescription, origins: bool) -> str:
    """Return the text of a description with an arm in its frames, and `origins` if asked."""
    document = _Document(description.text)
    friction = split_friction(arm, FRICTION)
    for i, name in enumerate(arm.joint_names):
        for body, parameters in _shared(arm.links[i, :-1], description.bodies[i]):
            document.set(('link', body), _inertial(parameters))
        values = {'damping': 'viscous', 'friction': 'Coulomb'}
        dynamics = {x: number(friction.values[i].get(y, 0.0)) for x, y in values.items()}
        document.set(('joint', name), {'dynamics': dynamics})
        if origins:
            document.set(('joint', name), {'origin': _origin(arm, description, i)})
    return document.edited()


def template_remarks(
    arm: ArmDescription, description: RobotDescription, origins: bool
) -> list[str]:
    """Return sentences on what was found and is not in the file."""
    remarks = gravity_remark(arm)
    rotors = zip(arm.joint_names, arm.links[:, ROTOR], strict=True)
    listed = ', '.join(f'{name} {rotor:.4g}' for name, rotor in rotors)
    remarks.append(
        'URDF has no element for the inertias of rotors; set them where you load it, as '
        f'armature: {listed}.'
    )
    turned = np.swapaxes(description.chain.rotations, 1, 2) @ arm.chain.rotations
    turn = np.degrees(np.linalg.norm(Rotation.from_matrix(turned).as_rotvec(), axis=1).max())
    shift = np.linalg.norm(arm.chain.translations - description.chain.translations, axis=1).max()
    if not origins and (turn > LEAST_TURN or shift > LEAST_SHIFT):
        remarks.append(
            f'The joints were found up to {turn:.2g} degrees and {1e3 * shift:.2g} mm from the '
            'origins of the file, which are kept; add --origins, or fit with '
            'fit.description_angle_deg: 0, which fits the links to these origins.'
        )
    return remarks


def _shared(whole: Array, bodies: tuple[Body, ...]) -> list[tuple[str, Array]]:
    """
    Return the new parameters of the bodies of a link, in their own frames.

    What is fixed to the link stays as it is, where the link itself can then exist; else as large
    a share of it as leaves a link that can.
    """
    own, *others = bodies
    fixed = [(body, moved(body.parameters, body.placement)) for body in others]
    total = sum((part for _, part in fixed), np.zeros_like(whole))
    share = 1.0
    while np.linalg.eigvalsh(pseudo_inertia(whole - share * total))[0] <= 0.0:
        share = 0.5 * share if share > 0.5**HALVINGS else 0.0
    out = [(own.name, moved(whole - share * total, np.linalg.inv(own.placement)))]
    if share < 1.0:
        out += [
            (body.name, share * body.parameters) for body in others if body.parameters[0] > 0.0
        ]
    return out


def _inertial(parameters: Array) -> Mapping[str, Mapping[str, str]]:
    if parameters[0] <= 0.0:
        mass, centre, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
    else:
        mass, centre, inertia = centre_of_mass_inertia(parameters)
    values = inertia[np.triu_indices(3)]
    return {
        'inertial/origin': {'xyz': numbers(centre), 'rpy': '0 0 0'},
        'inertial/mass': {'value': number(mass)},
        'inertial/inertia': {
            name: number(value) for name, value in zip(INERTIAS, values, strict=True)
        },
    }


def _origin(arm: ArmDescription, description: RobotDescription, i: int) -> Mapping[str, str]:
    """Return the origin of a joint with which its frame lies where it was found."""
    found = transform(arm.chain.rotations[i], arm.chain.translations[i])
    to_axis = transform(description.to_axis[i], np.zeros(3))
    place = np.linalg.inv(description.before[i]) @ found @ np.linalg.inv(to_axis)
    return {'xyz': numbers(place[:3, 3]), 'rpy': numbers(roll_pitch_yaw(place[:3, :3]))}


class _Element(NamedTuple):
    start: int
    """Of the start tag, in bytes."""
    opened: int
    """After the start tag."""
    close: int
    """Of the end tag; -1 where the element is empty."""


@dataclass
class _Edit:
    start: int
    end: int
    text: str


class _Document:
    """An XML text of which attributes are replaced in place."""

    def __init__(self, text: str) -> None:
        self._bytes = text.encode()
        self._elements = _elements(self._bytes)
        self._edits: list[_Edit] = []

    def set(self, owner: tuple[str, str], changes: Mapping[str, Mapping[str, str]]) -> None:
        """Set attributes of elements, by their path below a link or joint, or add them."""
        missing: dict[str, dict[str, Mapping[str, str]]] = {}
        for path, attributes in changes.items():
            element = self._elements.get((*owner, path))
            if element is not None:
                self._set_attributes(element, attributes)
            else:
                parent, _, name = path.rpartition('/')
                missing.setdefault(parent, {})[name] = attributes
        for parent, children in missing.items():
            text = ''.join(_tag(name, attributes) for name, attributes in children.items())
            self._append(owner, parent, text)

    def edited(self) -> str:
        """Return the text with all changes."""
        out, at = [], 0
        for edit in sorted(self._edits, key=lambda each: (each.start, each.end)):
            out += [self._bytes[at : edit.start], edit.text.encode()]
            at = edit.end
        return b''.join([*out, self._bytes[at:]]).decode()

    def _set_attributes(self, element: _Element, attributes: Mapping[str, str]) -> None:
        tag = self._bytes[element.start : element.opened].decode()
        for name, value in attributes.items():
            found = re.search(ATTRIBUTE.format(name), tag)
            if found is None:
                end = element.start + len(tag.rstrip('/>').rstrip().encode())
                self._edits.append(_Edit(end, end, f' {name}={quoteattr(value)}'))
                continue
            if not _equal(found[1][1:-1], value):
                start, end = (element.start + len(tag[:x].encode()) for x in found.span(1))
                self._edits.append(_Edit(start, end, quoteattr(value)))

    def _append(self, owner: tuple[str, str], parent: str, text: str) -> None:
        element = self._elements.get((*owner, parent))
        if element is None:
            element, text = self._elements[(*owner, '')], f'<{parent}>{text}</{parent}>'
        if element.close < 0:  # <link name="x"/>
            tag = self._bytes[element.start : element.opened].decode()
            name = tag[1:].split()[0].rstrip('/>')
            start = element.start + len(tag.rstrip('/>').rstrip().encode())
            self._edits.append(_Edit(start, element.opened, f'>{text}</{name}>'))
        else:
            self._edits.append(_Edit(element.close, element.close, text))


def _elements(content: bytes) -> dict[tuple[str, str, str], _Element]:
    """Return what lies in the links and joints of a URDF, by kind, name and path below it."""
    parser = expat.ParserCreate('utf-8')
    found: dict[tuple[str, str, str], _Element] = {}
    path: list[str] = []
    places: list[int] = []
    owner = ('', '')

    def begin(tag: str, attributes: dict[str, str]) -> None:
        nonlocal owner
        path.append(tag)
        places.append(parser.CurrentByteIndex)
        if len(path) == 2:
            owner = tag, attributes.get('name', '')

    def end(_: str) -> None:
        start, close = places.pop(), parser.CurrentByteIndex
        below = '/'.join(path[2:])
        if len(path) >= 2 and (*owner, below) not in found:
            opened = _end_of_tag(content, start)
            empty = content[opened - 2 : opened] == b'/>'
            found[(*owner, below)] = _Element(start, opened, -1 if empty else close)
        path.pop()

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.Parse(content, True)
    return found


def _end_of_tag(content: bytes, start: int) -> int:
    found = re.compile(rb'<(?:[^>"\']|"[^"]*"|\'[^\']*\')*>').match(content, start)
    assert found is not None, 'a parser has found it'
    return found.end()


def _tag(name: str, attributes: Mapping[str, str]) -> str:
    pairs = ''.join(f' {key}={quoteattr(value)}' for key, value in attributes.items())
    return f'<{name}{pairs}/>'


def _equal(old: str, new: str) -> bool:
    try:
        return [float(x) for x in old.split()] == [float(x) for x in new.split()]
    except ValueError:
        return False
