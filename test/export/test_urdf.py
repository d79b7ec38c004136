"""The URDF in particular."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import shutil
import subprocess
import xml.etree.ElementTree as ET

from export.arms import model_of, panda, random_arm
from export.readers import rotor_inertias, states_of
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
import yaml

from lip_id_ros.export.arm import describe
from lip_id_ros.export.text import number, roll_pitch_yaw
from lip_id_ros.export.urdf import RADIUS, to_urdf
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.regressor import torque_regressor

pinocchio = pytest.importorskip('pinocchio')


def test_it_says_what_was_recorded() -> None:
    arm = random_arm('RP')
    root = ET.fromstring(to_urdf(arm))
    joints = root.findall('joint')
    assert [x.get('name') for x in joints] == ['joint_1', 'joint_2']
    assert [x.get('type') for x in joints] == ['revolute', 'prismatic']
    for i, joint in enumerate(joints):
        limit = joint.find('limit')
        assert limit is not None
        values = [float(limit.get(x, 'nan')) for x in ('lower', 'upper', 'velocity', 'effort')]
        r = arm.ranges
        assert values == [r.q_min[i], r.q_max[i], r.dq_max[i], r.tau_max[i]]
        dynamics = joint.find('dynamics')
        assert dynamics is not None
        assert float(dynamics.get('damping', 'nan')) == arm.friction.coefficients[3 * i]
        assert float(dynamics.get('friction', 'nan')) == arm.friction.coefficients[3 * i + 1]
    np.testing.assert_array_equal(rotor_inertias(root, arm.joint_names), arm.links[:, ROTOR])


def test_limits_are_the_largest_of_both_directions() -> None:
    model = model_of(random_arm('RP'))
    low, high = -np.array([[1.0, 0.5], [2.0, 3.0], [7.0, 5.0]]), np.ones((3, 2))
    ranges = describe(replace(model, training_range=(low, high)), 'arm').arm.ranges
    assert ranges.q_min.tolist() == [-1.0, -0.5]
    assert ranges.q_max.tolist() == [1.0, 1.0]
    assert ranges.dq_max.tolist() == [2.0, 3.0]
    assert ranges.ddq_max.tolist() == [7.0, 5.0]


def test_axes_and_links_can_be_seen() -> None:
    arm = random_arm('RPR')
    links = ET.fromstring(to_urdf(arm)).findall('link')[1:]
    ends = [*arm.chain.translations[1:], np.zeros(3)]
    for link, end, slides in zip(links, ends, arm.chain.prismatic, strict=True):
        shapes = [shape.tag for shape in link.findall('visual/geometry/*')]
        rods = ['cylinder'] * int(np.linalg.norm(end) > RADIUS)
        assert shapes == ['box' if slides else 'cylinder', *rods]
        if not rods:
            continue
        rod = link.findall('visual')[1]
        place, shape = rod.find('origin'), rod.find('geometry/cylinder')
        assert place is not None
        assert shape is not None
        at = np.array([float(x) for x in place.get('xyz', '').split()])
        turn = Rotation.from_euler('xyz', [float(x) for x in place.get('rpy', '').split()])
        half = 0.5 * float(shape.get('length', 'nan')) * turn.as_matrix()[:, 2]
        np.testing.assert_allclose([at - half, at + half], [np.zeros(3), end], atol=1e-12)


def test_the_header_has_remarks_and_the_table() -> None:
    text = to_urdf(panda())
    header = text[: text.index('-->')]
    assert 'A remark with - - and' in header
    assert 'drake:rotor_inertia' in header
    row = next(line for line in header.splitlines() if line.strip().startswith('joint_4'))
    assert [float(x) for x in row.split()[1:]] == [90.0, 0.0825, 0.0, 0.0]


def test_ros_reads_it_as_one_text() -> None:
    """`-p robot_description:="$(cat arm.urdf)"` is read as YAML, in which `a: b` is a mapping."""
    text = to_urdf(random_arm('RPR'))
    assert yaml.safe_load(text).startswith('<?xml')
    assert 'rotor inertia - URDF has no element for it.' in text


def test_links_can_exist() -> None:
    model = pinocchio.buildModelFromXML(to_urdf(random_arm('RPRPRR')))
    for body in list(model.inertias)[1:]:
        a, b, c = np.linalg.eigvalsh(body.inertia)
        assert a > 0.0
        assert a + b > c
        assert body.mass > 0.0


@pytest.mark.skipif(shutil.which('check_urdf') is None, reason='needs check_urdf')
@pytest.mark.parametrize('kinds', ['RRRRRRR', 'PRP', 'P'])
def test_check_urdf_reads_it(kinds: str, tmp_path: Path) -> None:
    file = tmp_path / 'arm.urdf'
    file.write_text(to_urdf(random_arm(kinds)))
    ran = subprocess.run(['check_urdf', file], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f'joint_{len(kinds)}_link' in ran.stdout


@pytest.mark.parametrize('kinds', ['RRRRRR', 'RPRPRR'])
def test_mujoco_reads_it(kinds: str) -> None:
    """Links and damping are those of the URDF; MuJoCo ignores its transmissions."""
    mujoco = pytest.importorskip('mujoco')
    arm = random_arm(kinds)
    model = mujoco.MjModel.from_xml_string(to_urdf(arm))
    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= flags.mjDSBL_FRICTIONLOSS | flags.mjDSBL_LIMIT
    model.opt.gravity[:] = arm.chain.gravity
    model.dof_armature[:] = arm.links[:, ROTOR]
    data = mujoco.MjData(model)
    viscous = arm.friction.coefficients[: 3 * len(kinds) : 3]
    for q, dq, ddq in states_of(arm, 20).transpose(1, 0, 2):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        regressor = torque_regressor(arm.chain, q[None], dq[None], ddq[None])[0]
        expected = regressor @ arm.links.ravel() + viscous * dq
        np.testing.assert_allclose(data.qfrc_inverse, expected, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize('seed', range(20))
def test_angles_give_the_rotation_back(seed: int) -> None:
    """Also where the pitch is a right angle, or nearly."""
    rng = np.random.default_rng(seed)
    pitch = [0.5 * np.pi, 0.5 * np.pi - 1e-9, -0.5 * np.pi, rng.uniform(-1.5, 1.5)][seed % 4]
    roll, yaw = rng.uniform(-np.pi, np.pi, 2)
    rotation = Rotation.from_euler('xyz', [roll, pitch, yaw]).as_matrix()
    again = Rotation.from_euler('xyz', roll_pitch_yaw(rotation)).as_matrix()
    np.testing.assert_allclose(again, rotation, atol=1e-14)


@pytest.mark.parametrize('value', [0.1, 1 / 3, -2.0, 1e-7, 123456.789, 0.0])
def test_numbers_read_back_as_they_were(value: float) -> None:
    assert float(number(value)) == value
    assert number(-1e-17) == '0'


def test_names_with_characters_of_xml() -> None:
    arm = replace(random_arm('RR'), joint_names=('a<b>"c"&', 'left/arm joint'))
    model = pinocchio.buildModelFromXML(to_urdf(arm))
    assert tuple(model.names)[1:] == arm.joint_names


@pytest.mark.parametrize('names', [('base', 'b'), ('base', 'base_link'), ('a---b', 'c--')])
def test_names_that_meet_others_or_end_comments(names: tuple[str, str]) -> None:
    arm = replace(random_arm('RR'), joint_names=names)
    assert tuple(pinocchio.buildModelFromXML(to_urdf(arm)).names)[1:] == names
    links = [link.get('name') for link in ET.fromstring(to_urdf(arm)).iter('link')]
    assert len(set(links)) == 3
