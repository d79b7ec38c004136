"""
An identified arm as MJCF, the format of MuJoCo (https://mujoco.readthedocs.io).

MuJoCo's own writer keeps six digits, too few to give the same torques. So the text is written
here, with all digits, and MuJoCo's `MjSpec` reads and compiles it before anyone else does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.errors import LipIdError, ModelError
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.text import (
    header_lines,
    left_out_remark,
    number,
    numbers,
    split_friction,
    xml_text,
)
from lip_id_ros.export.urdf import (
    base_name,
    centre_of_mass_inertia,
    JOINT_LENGTH,
    JOINT_RADIUS,
    link_name,
    RADIUS,
)
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.couplings import coupling_matrix

FRICTION = ('viscous', 'quadratic viscous', 'Coulomb', 'joint spring')
"""Terms of friction that MJCF can express: damping, frictionloss, stiffness."""
COMPILER = {
    'angle': 'radian',
    'autolimits': 'true',
    'balanceinertia': 'false',
    'boundinertia': '0',
    'boundmass': '0',
    'fusestatic': 'false',
    'inertiafromgeom': 'false',
}
START = 'middle'
"""Key from which a simulation may begin, within all ranges."""
SHOWN = {'contype': '0', 'conaffinity': '0', 'group': '2', 'mass': '0'}
DARK = '0.25 0.3 0.35 1'
COUPLED = (
    'coupled positions: the joints here are those of the links. A recorded position that is '
    'another one is the length of the tendon whose name ends with _drive; its motor, rotor and '
    'friction pull there.'
)
REMARKS = (
    'friction: damping is viscous friction (a second number: in proportion to the square of the '
    'velocity), frictionloss the Coulomb torque, stiffness a spring of the joint; armature is the '
    'inertia of the rotor, seen through its gear.',
    'Capsules show the links, cylinders and boxes the axes of the joints; they have no mass and '
    'touch nothing.',
    'The key `middle` is the middle of the recorded ranges: begin there (mj_resetDataKeyframe), '
    'since zero may lie outside.',
)


def to_mjcf(arm: ArmDescription) -> str:
    """Return an arm in standard frames as MJCF, compiled by MuJoCo; ModelError if it refuses."""
    friction = split_friction(arm, FRICTION)
    remarks = (
        *REMARKS,
        *([COUPLED] if arm.chain.couplings.size else []),
        *left_out_remark(arm, friction.left_out.basis.terms, 'MJCF'),
    )
    root = ET.Element('mujoco', {'model': arm.name})
    ET.SubElement(root, 'compiler', COMPILER)
    option = {'gravity': numbers(arm.chain.gravity), 'integrator': 'implicitfast'}
    ET.SubElement(root, 'option', option)
    world = ET.SubElement(root, 'worldbody')
    ET.SubElement(world, 'light', {'pos': '0 0 3', 'dir': '0 0 -1', 'directional': 'true'})
    parent = ET.SubElement(world, 'body', {'name': base_name(arm.joint_names)})
    actuators, tendons = ET.Element('actuator'), ET.Element('tendon')
    matrix = coupling_matrix(arm.chain)
    for i, reported in enumerate(np.linalg.inv(matrix)):
        name, drive = arm.joint_names[i], _drive(arm, i, friction.values[i])
        is_coupled = np.count_nonzero(reported) > 1
        parent = _body(parent, arm, i, {} if is_coupled else drive)
        moved = {'tendon': f'{name}_drive'} if is_coupled else {'joint': name}
        ET.SubElement(actuators, 'motor', {'name': f'{name}_motor', **moved})
        if is_coupled:
            tendons.append(_tendon(moved['tendon'], arm.joint_names, reported, drive))
    root.extend([tendons, actuators] if len(tendons) else [actuators])
    middle = 0.5 * (arm.ranges.q_min + arm.ranges.q_max)
    key = {'name': START, 'qpos': numbers(matrix @ middle)}
    ET.SubElement(ET.SubElement(root, 'keyframe'), 'key', key)
    text = xml_text(root, header_lines(arm, remarks))
    compiled(text)
    return text


def compiled(text: str) -> Any:
    """Return MuJoCo's model of an MJCF; LipIdError without MuJoCo, ModelError if refused."""
    mujoco = import_mujoco()
    try:
        return mujoco.MjSpec.from_string(text).compile()
    except ValueError as error:
        raise ModelError(
            f'MuJoCo was to read the exported arm, but refuses it ({error}); '
            'export another format, or fit the arm anew.'
        ) from error


def import_mujoco() -> Any:
    """Return the module of MuJoCo; LipIdError if it is not installed."""
    try:
        import mujoco  # optional: only this format needs it
    except ImportError as error:
        raise LipIdError(
            f'MJCF is read by MuJoCo before it is written, and MuJoCo is missing ({error}); '
            "install it with `pip install 'lip_id_ros[export]'`."
        ) from error
    return mujoco


def _body(parent: ET.Element, arm: ArmDescription, i: int, drive: dict[str, str]) -> ET.Element:
    x, y, z, w = Rotation.from_matrix(arm.chain.rotations[i]).as_quat(canonical=True)
    place = {'pos': numbers(arm.chain.translations[i]), 'quat': numbers([w, x, y, z])}
    body = ET.SubElement(parent, 'body', {'name': link_name(arm.joint_names[i]), **place})
    mass, centre, inertia = centre_of_mass_inertia(arm.links[i])
    entries = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    inertial = {'pos': numbers(centre), 'mass': number(mass), 'fullinertia': numbers(entries)}
    ET.SubElement(body, 'inertial', inertial)
    kind = 'slide' if arm.chain.prismatic[i] else 'hinge'
    joint = {'name': arm.joint_names[i], 'type': kind, 'axis': '0 0 1'}
    ET.SubElement(body, 'joint', {**joint, **drive})
    end = arm.chain.translations[i + 1] if i + 1 < arm.n_joints else np.zeros(3)
    _show(body, arm.chain.prismatic[i], end)
    return body


def _show(body: ET.Element, prismatic: bool, end: Array) -> None:
    """Show the axis of a body's joint, and the link to the next joint."""
    half = 0.5 * JOINT_LENGTH
    joint = {'type': 'cylinder', 'size': numbers([JOINT_RADIUS, half])}
    if prismatic:
        joint = {'type': 'box', 'size': numbers([JOINT_RADIUS, JOINT_RADIUS, half])}
    ET.SubElement(body, 'geom', {**joint, **SHOWN, 'rgba': DARK})
    if np.linalg.norm(end) > RADIUS:
        capsule = {'type': 'capsule', 'fromto': numbers([0.0, 0.0, 0.0, *end])}
        ET.SubElement(body, 'geom', {**capsule, 'size': number(RADIUS), **SHOWN})


def _tendon(
    name: str, joints: Sequence[str], reported: Array, drive: dict[str, str]
) -> ET.Element:
    """Return a tendon as long as the reported position of a joint, a sum over joints, (n,)."""
    at_zero = {'springlength': '0'} if 'stiffness' in drive else {}
    tendon = ET.Element('fixed', {'name': name, **drive, **at_zero})
    for joint, share in zip(joints, reported, strict=True):
        if share != 0.0:
            ET.SubElement(tendon, 'joint', {'joint': joint, 'coef': number(share)})
    return tendon


def _drive(arm: ArmDescription, i: int, friction: dict[str, float]) -> dict[str, str]:
    viscous, square, coulomb, spring = (friction.get(term, 0.0) for term in FRICTION)
    drive = {
        'range': numbers([arm.ranges.q_min[i], arm.ranges.q_max[i]]),
        'armature': number(arm.links[i, ROTOR]),
        'damping': numbers([viscous, square] if square > 0.0 else [viscous]),
        'frictionloss': number(coulomb),
    }
    return {**drive, 'stiffness': number(spring)} if spring > 0.0 else drive
