"""A URDF as it is read, against pinocchio, and what is refused."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from lip_id_ros.description.robot import rotation_to
from lip_id_ros.description.urdf import load_description, moving_joints, parse_description
from lip_id_ros.errors import DataError, SourceError
from lip_id_ros.rigid_body.regressor import torque_regressor

TIAGO = ('torso_lift_joint', *(f'arm_{i}_joint' for i in range(1, 8)))
UR10 = (
    *('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint'),
    *('wrist_1_joint', 'wrist_2_joint', 'wrist_3_joint'),
)
ARMS = {
    'panda.urdf': tuple(f'panda_joint{i}' for i in range(1, 8)),
    'tiago_no_hand.urdf': TIAGO,
    'ur10_robot.urdf': UR10,
    'kinova.urdf': tuple(f'j2s6s200_joint_{i}' for i in range(1, 7)),
}
SMALL = """<?xml version="1.0"?>
<robot name="small">
  <link name="base"/>
  <link name="upper">
    <inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
  </link>
  <link name="lower"/>
  <joint name="a" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
  </joint>
  <joint name="b" type="prismatic"><parent link="upper"/><child link="lower"/></joint>
</robot>
"""
MIMIC = """<link name="side"/><joint name="c" type="revolute">
  <parent link="upper"/><child link="side"/><mimic joint="a"/></joint></robot>"""
FAR = 'type="prismatic"><origin xyz="0 333 0"/>'


def types_of(names: tuple[str, ...]) -> list[str]:
    return ['prismatic' if 'lift_joint' in x and 'torso' in x else 'revolute' for x in names]


@pytest.mark.parametrize('name', ARMS)
def test_torques_are_those_of_pinocchio(name: str, shared_data: Path) -> None:
    """Fixed joints, other branches, axes that are not z, continuous and prismatic joints."""
    pinocchio = pytest.importorskip('pinocchio')
    file, joints = shared_data / 'urdf' / name, ARMS[name]
    description = load_description(file, joints, types_of(joints))
    model = pinocchio.buildModelFromXML(file.read_text())
    locked = [model.getJointId(x) for x in list(model.names)[1:] if x not in joints]
    model = pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model))
    model.gravity.linear = description.chain.gravity
    data, neutral = model.createData(), pinocchio.neutral(model)
    states = np.random.default_rng(0).uniform(-2.0, 2.0, (3, 20, len(joints)))
    found = torque_regressor(description.chain, *states) @ description.links.ravel()
    for q, dq, ddq, tau in zip(*states, found, strict=True):
        at = pinocchio.integrate(model, neutral, q)
        expected = pinocchio.rnea(model, data, at, dq, ddq)
        np.testing.assert_allclose(tau, expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    'axis', [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (0.6, 0.0, -0.8), (0.0, 0.28, 0.96)]
)
def test_the_axis_becomes_z(axis: tuple[float, float, float]) -> None:
    rotation = rotation_to(np.array(axis, dtype=np.float64))
    np.testing.assert_allclose(rotation @ [0.0, 0.0, 1.0], axis, atol=1e-15)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_a_text_is_a_description() -> None:
    found = load_description(SMALL, ('a', 'b'), ('revolute', 'prismatic'))
    assert found.place == 'robot_description'
    assert found.links[:, 0].tolist() == [2.0, 0.0]
    moved = SMALL.replace('<child link="lower"/>', '<child link="lower"/><origin xyz="0 0 1"/>')
    other = load_description(moved, ('a', 'b'), ('revolute', 'prismatic'))
    assert other.fingerprint != found.fingerprint
    same = load_description(SMALL.replace('"2"', '"3"'), ('a', 'b'), ('revolute', 'prismatic'))
    assert same.fingerprint == found.fingerprint


@pytest.mark.parametrize(
    ('change', 'sentence'),
    [
        (('<robot ', '<robot xmlns:xacro="x" '), None),
        (('<robot name="small">', '<robot name="small"><xacro:include filename="x"/>'), 'xacro'),
        (('"2"', '"${mass}"'), 'is the source of a xacro'),
        (('<robot name', '<!DOCTYPE robot><robot name'), 'document type'),
        (('</robot>', ''), 'is not a URDF'),
        (('robot', 'sdf'), '<robot> was expected, but <sdf> came'),
        (('"2"', '"heavy"'), "was expected to be a number of at most .*, not 'heavy'"),
        (('"2"', '"nan"'), "was expected to be a number of at most .*, not 'nan'"),
        (('"2"', '"1e308"'), "a number of at most 1e\\+06, not '1e308'"),
        (('"2"', '"-2"'), 'was expected to be a mass of zero or more, not -2'),
        (('"0 0 1"', '"0 1e308 1e308"'), "xyz of 'a' in .* at most 1e\\+06, not '1e308'"),
        (('"0 0 1"', '"0 0 5e-324"'), 'has no direction'),
        (('"0 0 1"', '"0 1"'), 'needs three numbers, but has 2'),
        (('"0 0 1"', '"0 0 0"'), 'has no direction'),
        (('name="b"', 'name="c"'), "joint 'b' of the data is not among .* which are a, c"),
        (('prismatic', 'revolute'), "joint 'b' is revolute in .*, but prismatic in the data"),
        (('<parent link="base"/>', ''), "joint 'a' in .* has no <parent"),
        (('<parent link="upper"/>', '<parent link="base"/>'), "to be carried by joint 'a'"),
        (('type="prismatic">', FAR), "in metres, but joint 'b' has one of 333 m;"),
        (('</robot>', MIMIC), "joint 'c' in .* moves with joint 'a' of the arm by <mimic>"),
        (('<child link="lower"/>', '<child link="upper"/>'), 'hangs on two joints'),
        (('<parent link="base"/>', '<parent link="lower"/>'), 'to be carried by the base'),
    ],
)  # fmt: skip
def test_what_is_no_description_is_refused(change: tuple[str, str], sentence: str | None) -> None:
    text = SMALL.replace(*change)
    assert text != SMALL
    arm = ('a', 'b'), ('revolute', 'prismatic')
    if sentence is None:
        parse_description(text, 'arm.urdf', *arm)
        return
    with pytest.raises(DataError, match=sentence):
        parse_description(text, 'arm.urdf', *arm)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    (tmp_path / 'arm.urdf').write_bytes(b'\xff\xfe<robot/>')
    with pytest.raises(DataError, match='is not a URDF in UTF-8'):
        load_description(tmp_path / 'arm.urdf', ('a',), ('revolute',))


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / 'pipe')
    for source in (tmp_path / 'pipe', '/dev/zero', tmp_path):
        with pytest.raises(SourceError, match='must be a regular file'):
            load_description(source, ('a',), ('revolute',))
    with pytest.raises(SourceError, match='a path must not contain NUL'):
        load_description('a\0b', ('a',), ('revolute',))


def test_a_file_too_large_for_a_description_is_refused(tmp_path: Path) -> None:
    with open(tmp_path / 'arm.urdf', 'wb') as file:
        file.truncate(10**9)
    with pytest.raises(DataError, match=r'is not a URDF: it has more than \d+ bytes'):
        load_description(tmp_path / 'arm.urdf', ('a',), ('revolute',))


def test_joints_that_move_by_themselves_come_from_the_base_on() -> None:
    assert moving_joints(SMALL, 'u') == (('a', 'b'), ('revolute', 'prismatic'))
    with_mimic = SMALL.replace('</robot>', MIMIC)
    assert moving_joints(with_mimic, 'u') == (('a', 'b'), ('revolute', 'prismatic'))
    with pytest.raises(DataError, match='u is not a URDF'):
        moving_joints('<arm/>', 'u')
