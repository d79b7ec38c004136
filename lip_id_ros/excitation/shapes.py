"""
The shapes of an arm and of what is around it, in the geometry of pinocchio and coal.

Meshes are replaced by their convex hulls, which contain them. A link without a shape, or whose
mesh is not at hand, counts as a capsule from its joint to the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import os
from pathlib import Path
from typing import Any
import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.settings import BASE, NONE, SpaceSettings
from lip_id_ros.rigid_body import Chain

NUMBERS = 6
"""Of a box: lowest x, y, z and highest x, y, z."""

RING = 16
"""Corners of the prism around a cylinder."""

TOOL_RADIUS, LEAST_LENGTH = 1e-3, 1e-6


@dataclass(frozen=True, eq=False)
class Shapes:
    """
    An arm in pinocchio's model, and its shapes: those of joint 0 are fixed to the base.

    `joints`: its moving joints from base to tip, as pinocchio counts them. `base`, shape (3,):
    where it is mounted, in the frame of the model [m]. `note`: which links have no shape of their
    own.
    """

    pin: Any
    coal: Any
    model: Any
    geometry: Any
    joints: tuple[int, ...]
    base: Array
    note: str = ''

    def link(self, number: int) -> str:
        """Return the name of the link that a shape belongs to."""
        shape = self.geometry.geometryObjects[number]
        if shape.parentFrame == 0:
            return str(shape.name)
        return str(self.model.frames[shape.parentFrame].name)


def described_shapes(description: RobotDescription, space: SpaceSettings) -> Shapes:
    """Return the shapes of a URDF's links; ConfigError if pinocchio is not installed."""
    pin, coal = _pinocchio()
    whole, lost = pin.buildModelFromXML(description.text), ''
    kind, folders = pin.GeometryType.COLLISION, _package_folders(description.place)
    try:
        geometry = pin.buildGeomFromUrdfString(whole, description.text, kind, package_dirs=folders)
    except ValueError as error:
        text, lost = without_meshes(description.text), f' ({str(error).strip().rstrip(".")})'
        geometry = pin.buildGeomFromUrdfString(whole, text, kind)
    for each in geometry.geometryObjects:
        if hasattr(each.geometry, 'buildConvexHull'):
            each.geometry.buildConvexHull(True, 'Qt')
            each.geometry = each.geometry.convex
    model, names = whole, description.joint_names
    locked = [k for k in range(1, whole.njoints) if whole.names[k] not in names]
    if locked:  # pinocchio refuses to reduce a model that has a link named as a joint
        model, (geometry,) = pin.buildReducedModel(whole, [geometry], locked, pin.neutral(whole))
    return _completed(pin, coal, model, geometry, names, description.before[0][:3, 3], space, lost)


def without_meshes(text: str) -> str:
    """Return a URDF without the shapes of links that are meshes."""
    root = ET.fromstring(text)
    for link in root.iter('link'):
        for shape in link.findall('collision'):
            if shape.find('.//mesh') is not None:
                link.remove(shape)
    return ET.tostring(root, encoding='unicode')


def chain_shapes(chain: Chain, names: Sequence[str], space: SpaceSettings) -> Shapes:
    """Return the links of a chain as capsules; ConfigError if pinocchio is not installed."""
    pin, coal = _pinocchio()
    model, joint = pin.Model(), 0
    for row, name in enumerate(names):
        kind = pin.JointModelPZ() if chain.prismatic[row] else pin.JointModelRZ()
        place = pin.SE3(np.array(chain.rotations[row]), np.array(chain.translations[row]))
        joint = model.addJoint(joint, kind, place, name)
        model.addJointFrame(joint)
    return _completed(pin, coal, model, pin.GeometryModel(), names, np.zeros(3), space)


def _completed(
    pin: Any,
    coal: Any,
    model: Any,
    geometry: Any,
    names: Sequence[str],
    base: Array,
    space: SpaceSettings,
    lost: str = '',
) -> Shapes:
    """Add the tool, and capsules where links have no shape."""
    joints = tuple(model.getJointId(name) for name in names)
    shaped = {each.parentJoint for each in geometry.geometryObjects}
    missing = [each for each in (0, *joints) if each not in shaped]
    ends = [model.jointPlacements[each].translation for each in joints]
    starts = [np.array([*ends[0][:2], base[2]]), *np.zeros((len(joints), 3))]
    if space.tool and len(space.tool) != 3:
        raise ConfigError(
            f'space.tool needs x, y and z of the tool, but has {len(space.tool)} numbers.'
        )
    tool = np.array(space.tool or (0.0, 0.0, 0.0))
    for joint, start, end in zip((0, *joints), starts, (*ends, tool), strict=True):
        if joint in missing:
            _add(pin, model, geometry, joint, *_capsule(pin, coal, start, end, space.radius_m))
    if space.tool:
        place = pin.SE3(np.eye(3), tool)
        _add(pin, model, geometry, joints[-1], coal.Sphere(TOOL_RADIUS), place)
    note = ''
    if missing:
        links = ', '.join(model.frames[_frame_of(model, each)].name for each in missing if each)
        note = (
            f'No shapes are at hand of {links or "the base"}{lost}: space.radius_m, '
            f'{space.radius_m:g} m, is taken for half the thickness.'
        )
    return Shapes(pin, coal, model, geometry, joints, np.asarray(base), note)


def _add(pin: Any, model: Any, geometry: Any, joint: int, shape: Any, place: Any) -> None:
    frame = _frame_of(model, joint)
    link = model.frames[frame].name if frame else 'the base'
    name = f'{link}_{len(geometry.geometryObjects)}' if frame else link
    geometry.addGeometryObject(pin.GeometryObject(name, joint, frame, place, shape))


def _frame_of(model: Any, joint: int) -> int:
    """Return the link that a joint moves, or the joint's own frame where the model has no link."""
    of_joint = [k for k, each in enumerate(model.frames) if each.parentJoint == joint]
    links = [k for k in of_joint if 'BODY' in str(model.frames[k].type)]
    return (links or of_joint)[0]


def _capsule(pin: Any, coal: Any, start: Array, end: Array, radius: float) -> tuple[Any, Any]:
    """Return the shape of a link between two points, and its place."""
    along, middle = end - start, 0.5 * (start + end)
    length = float(np.linalg.norm(along))
    if length < LEAST_LENGTH:
        return coal.Sphere(radius), pin.SE3(np.eye(3), middle)
    turn = Rotation.align_vectors(along[None] / length, [[0.0, 0.0, 1.0]])[0].as_matrix()
    return coal.Capsule(radius, length), pin.SE3(turn, middle)


def surroundings(shapes: Shapes, space: SpaceSettings) -> list[int]:
    """Add the floor, the boxes and the sides of `space.keep_in`; return their numbers."""
    found = list(_surroundings(shapes, space))
    first = len(shapes.geometry.geometryObjects)
    for name, shape, place in found:
        shapes.geometry.addGeometryObject(shapes.pin.GeometryObject(name, 0, 0, place, shape))
    return list(range(first, first + len(found)))


def _surroundings(shapes: Shapes, space: SpaceSettings) -> Iterator[tuple[str, Any, Any]]:
    coal, here, upwards = shapes.coal, shapes.pin.SE3.Identity(), np.array([0.0, 0.0, 1.0])
    if space.floor_m != NONE:
        height = shapes.base[2] if space.floor_m == BASE else float(space.floor_m)
        yield FLOOR, coal.Halfspace(upwards, height), here
    for number, (low, high) in enumerate(boxes(space.boxes, 'space.boxes'), start=1):
        place = shapes.pin.SE3(np.eye(3), 0.5 * (low + high))
        yield f'box {number} of space.boxes', coal.Box(*(high - low)), place
    for low, high in boxes(space.keep_in, 'space.keep_in'):
        for axis, name in zip(np.eye(3), 'xyz', strict=True):
            for sign, end in ((1.0, low), (-1.0, high)):
                side = coal.Halfspace(sign * axis, sign * float(axis @ end))
                yield f'the end of space.keep_in at {name} = {axis @ end:g}', side, here


FLOOR = 'the floor'


def boxes(numbers: Sequence[float], name: str) -> list[tuple[Array, Array]]:
    """Return lowest and highest corners of boxes; ConfigError if they are none."""
    if len(numbers) % NUMBERS:
        raise ConfigError(
            f'{name} needs {NUMBERS} numbers for each box, lowest and highest x, y, z, but '
            f'has {len(numbers)}; correct it.'
        )
    found = [(each[:3], each[3:]) for each in np.reshape(numbers, (-1, NUMBERS)).astype(float)]
    if any(np.any(low >= high) for low, high in found):
        raise ConfigError(f'{name} has a box whose lowest corner is not below its highest one.')
    return found


def outline(shape: Any) -> tuple[Array, float]:
    """Return points (K, 3) and a radius: balls around the points, whose hull has the shape."""
    if hasattr(shape, 'points'):
        return np.array(shape.points()), 0.0
    if hasattr(shape, 'halfSide'):
        corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
        return corners * np.asarray(shape.halfSide), 0.0
    ends = getattr(shape, 'halfLength', 0.0) * np.array([[0, 0, 1.0], [0, 0, -1.0]])
    if type(shape).__name__ != 'Cylinder':
        return ends, float(shape.radius)
    turns = np.arange(RING) * 2.0 * np.pi / RING
    ring = np.stack([np.cos(turns), np.sin(turns), 0.0 * turns], axis=1)
    ring *= shape.radius / np.cos(np.pi / RING)
    return np.concatenate([ring + end for end in ends]), 0.0


def _pinocchio() -> tuple[Any, Any]:
    """Return pinocchio and coal; ConfigError, with what to do, where they are not installed."""
    try:
        import coal
        import pinocchio  # both are optional: only this check and simulations need them
    except ImportError as error:
        raise ConfigError(
            'the distances of links from floor, boxes and each other need pinocchio, which is not '
            f"installed ({error}); pip install 'lip_id_ros[sim]', or give limits in numbers and "
            'no URDF, and look at the motion yourself.'
        ) from error
    return pinocchio, coal


def _package_folders(place: str) -> list[str]:
    """Return where packages of meshes may be: in ROS workspaces, and around the file."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    paths = os.environ.get('ROS_PACKAGE_PATH', '').split(os.pathsep)
    around = [str(each) for each in Path(place).absolute().parents] if Path(place).exists() else []
    found = [*(f'{each}/share' for each in prefixes if each), *(each for each in paths if each)]
    return [*found, *around]
