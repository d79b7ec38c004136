"""The MJCF in particular."""

from __future__ import annotations

from dataclasses import replace

from export.arms import arm_of, COUPLED, random_arm
from export.readers import states_of
import numpy as np
import pytest

from lip_id_ros.errors import ModelError
from lip_id_ros.export.mjcf import compiled, to_mjcf
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.couplings import coupling_matrix
from lip_id_ros.rigid_body.regressor import kinetic_regressor, potential_regressor

mujoco = pytest.importorskip('mujoco')


def test_words_of_mujoco() -> None:
    """Spring of joint 3, quadratic friction of joint 3: as `every_friction` gives them."""
    arm = random_arm('RPRRRR')
    model = compiled(to_mjcf(arm))
    np.testing.assert_array_equal(model.dof_armature, arm.links[:, ROTOR])
    np.testing.assert_array_equal(model.dof_frictionloss, arm.friction.coefficients[1:18:3])
    np.testing.assert_array_equal(model.jnt_range[:, 0], arm.ranges.q_min)
    np.testing.assert_array_equal(model.opt.gravity, arm.chain.gravity)
    names = [model.joint(i).name for i in range(6)]
    assert names == list(arm.joint_names)
    assert list(model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE) == list(arm.chain.prismatic)


def test_energies_are_those_of_the_arm() -> None:
    arm = random_arm('RPRRRR')
    model = compiled(to_mjcf(arm))
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    model.jnt_stiffness[:] = 0.0
    model.dof_armature[:] = arm.links[:, ROTOR]
    data = mujoco.MjData(model)
    q, dq, _ = states_of(arm, 20)
    energies = []
    for data.qpos[:], data.qvel[:] in zip(q, dq, strict=True):
        mujoco.mj_forward(model, data)
        energies.append(data.energy.copy())
    potential, kinetic = np.array(energies).T
    expected = potential_regressor(arm.chain, q) @ arm.links.ravel()
    np.testing.assert_allclose(np.diff(potential), np.diff(expected), atol=1e-10)
    expected = kinetic_regressor(arm.chain, q, dq) @ arm.links.ravel()
    np.testing.assert_allclose(kinetic, expected, rtol=1e-10)


def test_tendons_of_coupled_positions() -> None:
    """They are as long as the reported positions, and have the rotors and friction there."""
    arm = arm_of(COUPLED)
    text = to_mjcf(arm)
    assert 'coupled positions - the joints here are those of the links' in ' '.join(text.split())
    model = compiled(text)
    assert [model.tendon(k).name for k in range(2)] == ['joint_3_drive', 'joint_4_drive']
    data = mujoco.MjData(model)
    q = states_of(arm, 1)[0, 0]
    data.qpos[:] = coupling_matrix(arm.chain) @ q
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.ten_length, q[2:], atol=1e-12)
    np.testing.assert_array_equal(model.tendon_armature, arm.links[2:, ROTOR])
    np.testing.assert_array_equal(model.dof_armature, [*arm.links[:2, ROTOR], 0.0, 0.0])
    np.testing.assert_allclose(model.tendon_range[:, 0], arm.ranges.q_min[2:])


def test_the_key_is_in_the_middle_of_reported_ranges_where_positions_are_coupled() -> None:
    arm = arm_of(COUPLED)
    ranges = replace(arm.ranges, q_min=arm.ranges.q_max - 0.2)
    model = compiled(to_mjcf(replace(arm, ranges=ranges)))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    middle = arm.ranges.q_max - 0.1
    np.testing.assert_allclose([*data.qpos[:2], *data.ten_length], middle, atol=1e-12)


def test_it_can_be_simulated() -> None:
    model = compiled(to_mjcf(random_arm('RRR')))
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert np.abs(data.qpos).max() > 1e-3


def test_what_mujoco_refuses_is_an_error() -> None:
    arm = random_arm('RR')
    links = arm.links.copy()
    links[0, 0] = -1.0
    with pytest.raises(ModelError, match='MuJoCo was to read the exported arm, but refuses it'):
        to_mjcf(replace(arm, links=links))


def test_the_key_lies_within_the_ranges_and_names_meet_no_others() -> None:
    """Ranges that zero is outside of, and a joint whose link is called as the base is."""
    arm = random_arm('RPR')
    ranges = replace(arm.ranges, q_min=arm.ranges.q_max + 1.0, q_max=arm.ranges.q_max + 3.0)
    model = compiled(to_mjcf(replace(arm, ranges=ranges, joint_names=('base', 'a---b', 'c'))))
    np.testing.assert_allclose(model.key_qpos[0], arm.ranges.q_max + 2.0)
