"""The reference arm against textbook mechanics: power balance, closed forms, structure of M."""

from __future__ import annotations

import importlib.util
from pathlib import Path
import sys

import numpy as np
import pytest

from benchmarks._changed_arms import (
    FrictionalArm,
    JointFriction,
    with_gravity,
    with_rotors,
    with_wrong_masses,
)
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
def test_gravity_that_turns_is_a_pendulum_that_turns_back(pendulum: SimulatedArm) -> None:
    q, still = motions(1)[0], np.zeros((7, 1))
    gravity = GRAVITY * np.array([-np.sin(0.3), 0.0, -np.cos(0.3)])
    turned = with_gravity(pendulum, gravity).inverse_dynamics(q, still, still)
    np.testing.assert_allclose(turned, pendulum.inverse_dynamics(q - 0.3, still, still))


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
@pytest.mark.parametrize('n_joints', [3, 7])
def test_power_of_the_torques_is_the_change_of_energy(n_joints: int) -> None:
    arm = panda(n_joints)
    trajectory = SinusoidTrajectory.random(MOTION.first(n_joints), np.random.default_rng(5))
    t, step = np.linspace(1.0, 40.0, 25), 1e-5

    def energy(times: Array) -> Array:
        q, dq, _ = trajectory.sample(times)
        return arm.kinetic(q, dq) + arm.potential(q)

    q, dq, ddq = trajectory.sample(t)
    power = np.sum(dq * arm.inverse_dynamics(q, dq, ddq), axis=1)

    change = (energy(t + step) - energy(t - step)) / (2 * step)
    np.testing.assert_allclose(power, change, atol=1e-6)


@needs_pinocchio
def test_forward_dynamics_invert_the_inverse_with_rotors() -> None:
    arm, rotors = panda(7), np.linspace(0.05, 0.2, 7)
    q, dq, ddq = motions(7, 1)
    turning = with_rotors(arm, rotors)

    tau = turning.inverse_dynamics(q, dq, ddq)

    np.testing.assert_allclose(turning.forward_dynamics(q[0], dq[0], tau[0]), ddq[0])
    np.testing.assert_allclose(tau - arm.inverse_dynamics(q, dq, ddq), rotors * ddq, atol=1e-12)
    added = turning.kinetic(q, dq) - arm.kinetic(q, dq)
    np.testing.assert_allclose(added, 0.5 * np.square(dq) @ rotors)


@needs_pinocchio
def test_locked_joints_keep_their_mass() -> None:
    whole, three = panda(7), panda(3)
    q = np.zeros((1, 7))
    q[0, 3:] = (-2.0, 0.0, 1.8, 0.7)

    torque = whole.inverse_dynamics(q, 0 * q, 0 * q)[:, :3]

    assert three.joint_names == ('panda_joint1', 'panda_joint2', 'panda_joint3')
    np.testing.assert_allclose(
        three.inverse_dynamics(q[:, :3], 0 * q[:, :3], 0 * q[:, :3]), torque, atol=1e-10
    )


@needs_pinocchio
def test_friction_acts_against_the_motion_and_leaves_the_energies(pendulum: SimulatedArm) -> None:
    arm = FrictionalArm(pendulum, JointFriction(np.array([0.5]), np.array([0.2])))
    q, dq, ddq = np.zeros((3, 3, 1))
    dq = np.array([[2.0], [-2.0], [0.0]])

    np.testing.assert_allclose(
        arm.inverse_dynamics(q, dq, ddq) - pendulum.inverse_dynamics(q, dq, ddq),
        [[1.2], [-1.2], [0.0]],
    )
    np.testing.assert_array_equal(arm.kinetic(q, dq), pendulum.kinetic(q, dq))
    np.testing.assert_array_equal(arm.potential(q), pendulum.potential(q))
    assert arm.joint_names == pendulum.joint_names


def bodies(arm: SimulatedArm) -> tuple[Array, Array, Array]:
    """Masses (n,), centres of mass (n, 3) and inertias (n, 3, 3) of the moving bodies."""
    each = list(arm._model.inertias)[1:]
    mass, lever, inertia = (
        np.array([getattr(body, name) for body in each]) for name in ('mass', 'lever', 'inertia')
    )
    return mass, lever, inertia


@needs_pinocchio
def test_wrong_masses_are_wrong_within_bounds() -> None:
    arm = panda(7)
    mass, centre, inertia = bodies(arm)
    heavy, same, spread = bodies(with_wrong_masses(arm, 0.2, 0.0, np.random.default_rng(3)))
    kept, shifted, unturned = bodies(with_wrong_masses(arm, 0.0, 0.02, np.random.default_rng(3)))
    share = heavy / mass - 1.0
    assert 0.1 < np.abs(share).max() <= 0.2
    np.testing.assert_allclose(spread, (1.0 + share)[:, None, None] * inertia)
    np.testing.assert_array_equal(same, centre)
    assert 0.015 < np.abs(shifted - centre).max() <= 0.02
    np.testing.assert_array_equal(kept, mass)
    np.testing.assert_array_equal(unturned, inertia)
    np.testing.assert_array_equal(bodies(arm)[0], mass)  # that of the right one stays


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
