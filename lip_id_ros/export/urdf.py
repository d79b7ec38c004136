"""
An identified arm as URDF (http://wiki.ros.org/urdf/XML).

URDF has no element for the inertia of a rotor, seen through its gear. It is written the way Drake
reads it: in the actuator of a transmission, with a gear ratio of one, so that the number is what
is added to the joint's own diagonal entry of the inertia matrix.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.text import (
    FrictionSplit,
    header_lines,
    left_out_remark,
    number,
    numbers,
    roll_pitch_yaw,
    split_friction,
    xml_text,
)
from lip_id_ros.joint_types import PRISMATIC, REVOLUTE
from lip_id_ros.rigid_body.chain import ROTOR

FRICTION = ('viscous', 'Coulomb')
"""Terms of friction that URDF can express: damping and friction."""
DRAKE = 'https://drake.mit.edu'
BASE = 'base_link'
INERTIAS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
RADIUS = 0.02
"""Of the cylinders that show the links [m]."""
JOINT_RADIUS, JOINT_LENGTH = 0.035, 0.1
"""Of the cylinders along the axes of revolute joints; prismatic joints are boxes as large [m]."""
REMARKS = (
    'rotor inertia: URDF has no element for it. The transmissions have it as Drake reads it '
    '(drake:rotor_inertia, gear ratio one): what is added to the diagonal of the inertia matrix. '
    'Readers that ignore transmissions lack it; set it there (armature in pinocchio and MuJoCo).',
    'friction: damping is viscous friction; friction is the Coulomb torque, whose sign is '
    'smooth in the model.',
)


def to_urdf(arm: ArmDescription) -> str:
    """Return an arm in standard frames as URDF."""
    friction = split_friction(arm, FRICTION)
    ET.register_namespace('drake', DRAKE)
    remarks = (*REMARKS, *left_out_remark(arm, friction.left_out.basis.terms, 'URDF'))
    root = ET.Element('robot', {'name': arm.name})
    ET.SubElement(root, 'link', {'name': base_name(arm.joint_names)})
    for i in range(arm.n_joints):
        root.append(_link(arm, i))
        root.append(_joint(arm, i, friction))
    for name, rotor in zip(arm.joint_names, arm.links[:, ROTOR], strict=True):
        if rotor > 0.0:
            root.append(_transmission(name, rotor))
    return xml_text(root, header_lines(arm, remarks))


def link_name(joint: str) -> str:
    """Return the name of the link that a joint moves."""
    return f'{joint}_link'


def base_name(joint_names: tuple[str, ...]) -> str:
    """Return a name for the base that no link has."""
    name = BASE
    while name in map(link_name, joint_names):
        name = f'{name}_'
    return name


def _link(arm: ArmDescription, i: int) -> ET.Element:
    link = ET.Element('link', {'name': link_name(arm.joint_names[i])})
    mass, centre, inertia = centre_of_mass_inertia(arm.links[i])
    inertial = ET.SubElement(link, 'inertial')
    ET.SubElement(inertial, 'origin', {'xyz': numbers(centre), 'rpy': '0 0 0'})
    ET.SubElement(inertial, 'mass', {'value': number(mass)})
    entries = zip(INERTIAS, inertia[np.triu_indices(3)], strict=True)
    ET.SubElement(inertial, 'inertia', {name: number(value) for name, value in entries})
    _show_joint(link, arm.chain.prismatic[i])
    if i + 1 < arm.n_joints:
        _show_link(link, arm.chain.translations[i + 1])
    return link


def centre_of_mass_inertia(parameters: Array) -> tuple[float, Array, Array]:
    """Return mass, centre of mass (3,) and inertia about it (3, 3) of a link's parameters."""
    mass, centre = float(parameters[0]), parameters[1:4] / parameters[0]
    xx, xy, xz, yy, yz, zz = parameters[4:10]
    about_origin = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    steiner = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return mass, centre, about_origin - steiner


def _show_joint(link: ET.Element, prismatic: bool) -> None:
    """Show the axis of a link's joint, the z axis of its frame."""
    geometry = ET.SubElement(ET.SubElement(link, 'visual'), 'geometry')
    if prismatic:
        size = (2.0 * JOINT_RADIUS, 2.0 * JOINT_RADIUS, JOINT_LENGTH)
        ET.SubElement(geometry, 'box', {'size': numbers(size)})
    else:
        _cylinder(geometry, JOINT_RADIUS, JOINT_LENGTH)


def _show_link(link: ET.Element, end: Array) -> None:
    """Show a link from its joint to the next."""
    length = float(np.linalg.norm(end))
    if length <= RADIUS:
        return
    along = Rotation.align_vectors(end[None] / length, np.array([[0.0, 0.0, 1.0]]))[0]
    visual = ET.SubElement(link, 'visual')
    place = {'xyz': numbers(0.5 * end), 'rpy': numbers(roll_pitch_yaw(along.as_matrix()))}
    ET.SubElement(visual, 'origin', place)
    _cylinder(ET.SubElement(visual, 'geometry'), RADIUS, length)


def _cylinder(geometry: ET.Element, radius: float, length: float) -> None:
    ET.SubElement(geometry, 'cylinder', {'radius': number(radius), 'length': number(length)})


def _joint(arm: ArmDescription, i: int, friction: FrictionSplit) -> ET.Element:
    name, ranges = arm.joint_names[i], arm.ranges
    kind = PRISMATIC if arm.chain.prismatic[i] else REVOLUTE
    joint = ET.Element('joint', {'name': name, 'type': kind})
    rpy = roll_pitch_yaw(arm.chain.rotations[i])
    place = {'xyz': numbers(arm.chain.translations[i]), 'rpy': numbers(rpy)}
    ET.SubElement(joint, 'origin', place)
    parent = link_name(arm.joint_names[i - 1]) if i > 0 else base_name(arm.joint_names)
    ET.SubElement(joint, 'parent', {'link': parent})
    ET.SubElement(joint, 'child', {'link': link_name(name)})
    ET.SubElement(joint, 'axis', {'xyz': '0 0 1'})
    limit = {
        'lower': number(ranges.q_min[i]),
        'upper': number(ranges.q_max[i]),
        'effort': number(ranges.tau_max[i]),
        'velocity': number(ranges.dq_max[i]),
    }
    ET.SubElement(joint, 'limit', limit)
    viscous, coulomb = (friction.values[i].get(term, 0.0) for term in FRICTION)
    dynamics = {'damping': number(viscous), 'friction': number(coulomb)}
    ET.SubElement(joint, 'dynamics', dynamics)
    return joint


def _transmission(joint: str, rotor: float) -> ET.Element:
    transmission = ET.Element('transmission', {'name': f'{joint}_transmission'})
    ET.SubElement(transmission, 'type').text = 'transmission_interface/SimpleTransmission'
    ET.SubElement(transmission, 'joint', {'name': joint})
    actuator = ET.SubElement(transmission, 'actuator', {'name': f'{joint}_motor'})
    ET.SubElement(actuator, f'{{{DRAKE}}}rotor_inertia', {'value': number(rotor)})
    ET.SubElement(actuator, f'{{{DRAKE}}}gear_ratio', {'value': '1'})
    return transmission
