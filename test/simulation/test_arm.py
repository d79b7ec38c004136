"""The reference arm against textbook mechanics: power balance, closed forms, structure of M."""

from __future__ import annotations

import importlib.util
from pathlib import Path
import sys

import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError, LipIdError
from lip_id_ros.simulation import panda, SimulatedArm, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION

needs_pinocchio = pytest.mark.skipif(
    importlib.util.find_spec('pinocchio') is None, reason='needs pinocchio (the extra sim)'
)
GRAVITY = 9.81
LINK = """
  <link name="{name}"><inertial>
    <origin xyz="{com}" rpy="0 0 0"/><mass value="{mass}"/>
    <inertia ixx="0.1" iyy="{inertia}" izz="0.1" ixy="0" ixz="0" iyz="0"/>
  </inertial></link>"""
JOINT = """
  <joint name="{name}" type="{kind}">
    <parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{origin}" rpy="0 0 0"/><axis xyz="{axis}"/>
    <limit lower="-3" upper="3" effort="9" velocity="9"/>
  </joint>"""


def write_urdf(path: Path, *elements: str) -> Path:
    path.write_text(f'<robot name="r">\n  <link name="base"/>{"".join(elements)}\n</robot>')
    return path


@pytest.fixture
def pendulum(tmp_path: Path) -> SimulatedArm:
    """One link of 2 kg, its centre 0.5 m below the hinge, 0.3 kg m^2 about that centre."""
    urdf = write_urdf(
        tmp_path / 'pendulum.urdf',
        LINK.format(name='bob', com='0 0 -0.5', mass=2, inertia=0.3),
        JOINT.format(
            name='hinge', kind='revolute', parent='base', child='bob', origin='0 0 0', axis='0 1 0'
        ),
    )
    return SimulatedArm(urdf, 1)


def motions(n_joints: int, n_samples: int = 7) -> tuple[Array, ...]:
    return tuple(np.random.default_rng(n_joints).normal(size=(3, n_samples, n_joints)))


@needs_pinocchio
def test_pendulum_is_the_textbook_one(pendulum: SimulatedArm) -> None:
    q, dq, ddq = motions(1)
    inertia = 0.3 + 2 * 0.5**2

    torque = inertia * ddq + 2 * GRAVITY * 0.5 * np.sin(q)

    np.testing.assert_allclose(pendulum.inverse_dynamics(q, dq, ddq), torque)
    np.testing.assert_allclose(pendulum.kinetic(q, dq), 0.5 * inertia * dq[:, 0] ** 2)
    np.testing.assert_allclose(pendulum.potential(q), -2 * GRAVITY * 0.5 * np.cos(q[:, 0]))
    assert pendulum.joint_names == ('hinge',)
    assert pendulum.joint_types == ('revolute',)


@needs_pinocchio
def test_lift_carries_its_weight(tmp_path: Path) -> None:
    urdf = write_urdf(
        tmp_path / 'lift.urdf',
        LINK.format(name='box', com='0 0 0', mass=4, inertia=0.1),
        JOINT.format(
            name='lift', kind='prismatic', parent='base', child='box', origin='0 0 0', axis='0 0 1'
        ),
    )
    arm = SimulatedArm(urdf, 1)
    q, dq, ddq = motions(1)

    np.testing.assert_allclose(arm.inverse_dynamics(q, dq, ddq), 4 * (ddq + GRAVITY))
    np.testing.assert_allclose(arm.potential(q), 4 * GRAVITY * q[:, 0])
    assert arm.joint_types == ('prismatic',)


@needs_pinocchio
def test_power_of_the_torques_is_the_change_of_energy() -> None:
    arm = panda(7)
    trajectory = SinusoidTrajectory.random(MOTION, np.random.default_rng(5))
    t, step = np.linspace(1.0, 40.0, 25), 1e-5

    def energy(times: Array) -> Array:
        q, dq, _ = trajectory.sample(times)
        return arm.kinetic(q, dq) + arm.potential(q)

    q, dq, ddq = trajectory.sample(t)
    power = np.sum(dq * arm.inverse_dynamics(q, dq, ddq), axis=1)

    change = (energy(t + step) - energy(t - step)) / (2 * step)
    np.testing.assert_allclose(power, change, atol=1e-6)


@needs_pinocchio
@pytest.mark.parametrize('n_joints', [0, 10])
def test_more_joints_than_the_robot_has(n_joints: int) -> None:
    with pytest.raises(DataError, match=rf'{n_joints} joints were asked of .*panda.urdf, .*'):
        panda(n_joints)


@needs_pinocchio
def test_a_file_that_is_no_robot(tmp_path: Path) -> None:
    path = tmp_path / 'other.urdf'
    path.write_text('<html/>')
    with pytest.raises(DataError, match=r'other\.urdf is not a URDF'):
        SimulatedArm(path, 1)


@needs_pinocchio
def test_a_continuous_joint_is_refused(tmp_path: Path) -> None:
    urdf = write_urdf(
        tmp_path / 'wheel.urdf',
        LINK.format(name='rim', com='0 0 0', mass=1, inertia=0.1),
        JOINT.format(
            name='hub', kind='continuous', parent='base', child='rim', origin='0 0 0', axis='0 1 0'
        ),
    )
    with pytest.raises(DataError, match=r'revolute or prismatic, not JointModelRUB'):
        SimulatedArm(urdf, 1)


def test_the_remedy_without_pinocchio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'pinocchio', None)
    with pytest.raises(LipIdError, match=r"pip install 'lip_id_ros\[sim\]'"):
        SimulatedArm(tmp_path / 'any.urdf', 1)


def test_the_remedy_without_robot_descriptions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('importlib.metadata.files', lambda name: None)
    with pytest.raises(LipIdError, match=r"example-robot-data.*pip install 'lip_id_ros\[sim\]'"):
        panda()
