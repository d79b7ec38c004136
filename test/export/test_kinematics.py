"""The table of Denavit and Hartenberg, and which of its numbers are marked."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from export.arms import model_of, panda, random_arm
import numpy as np
import pytest

from lip_id_ros.export.kinematics import Kinematics, kinematics_of, model_kinematics, STD_KEYS
from lip_id_ros.export.text import header_lines

pytest.importorskip('pinocchio')


def deviations(**some: list[float]) -> dict[str, Any]:
    return {'denavit_hartenberg': {**dict.fromkeys(STD_KEYS, [0.0] * 3), **some}}


def test_numbers_are_those_of_the_panda() -> None:
    arm = panda()
    found = kinematics_of(arm.joint_names, arm.chain, {})
    np.testing.assert_allclose(found.values[3], [90.0, 0.0825, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(
        np.abs(found.values[:, 3]), [0, 0, 0.316, 0, 0.384, 0, 0], atol=1e-9
    )
    assert found.identified.all()
    model = model_kinematics(model_of(arm))
    assert model is not None
    np.testing.assert_allclose(model.values, found.values, atol=1e-9)


def test_deviations_decide_what_is_identified() -> None:
    arm = random_arm('RRR')
    chain = arm.chain._replace(translations=np.array([[0, 0, 0], [0.4, 0, 0], [0.01, 0, 0.0]]))
    summary = deviations(length_std_m=[0.0, 0.06, 0.017], angle_std_deg=[4.9, 5.1, 0.0])
    found = kinematics_of(arm.joint_names, chain, summary)
    np.testing.assert_array_equal(found.identified[:, 1], [True, True, False])
    np.testing.assert_array_equal(found.identified[:, 2], [True, False, True])


def test_without_gravity_distances_are_known_up_to_a_factor() -> None:
    arm = random_arm('RRR')
    chain = arm.chain._replace(gravity=np.zeros(3))
    distances = {'length_std_m': [0.0, 1e-3, 1e-3], 'offset_std_m': [0.0, 1e-3, 0.0]}
    angles = {'twist_std_deg': [0.0, 0.5, 2.0], 'angle_std_deg': [1.0, 0.5, 2.0]}
    summary = deviations(**distances, **angles)
    assert kinematics_of(arm.joint_names, arm.chain, summary).identified.all()
    found = kinematics_of(arm.joint_names, chain, summary)
    np.testing.assert_array_equal(found.identified[:, 1], [True, False, False])
    np.testing.assert_array_equal(found.identified[:, 3], [True, False, True])
    np.testing.assert_array_equal(found.std[:, ::2], np.transpose([*angles.values()]))
    assert found.identified[:, ::2].all()
    assert found.to_json()['joint_2']['length_std_m'] is None
    described = {**summary, 'description': {}}
    assert kinematics_of(arm.joint_names, chain, described).identified.all()


def test_a_tilted_frame_is_shown_wherever_the_table_is() -> None:
    values = np.zeros((2, 4))
    tilted = Kinematics(('a', 'b'), values, np.zeros((2, 4)), np.array([0.0, 1.5]))
    assert tilted.header[-1] == 'tilt [deg]'
    assert [row[-1] for row in tilted.cells()] == ['0.00', '1.50']
    assert 'Rot_y(tilt)' in tilted.transform
    assert [joint['tilt_deg'] for joint in tilted.to_json().values()] == [0.0, 1.5]
    plain = Kinematics(('a', 'b'), values, np.zeros((2, 4)), np.zeros(2))
    assert len(plain.header) == 4 == len(plain.cells()[0]) - 1


def test_files_mark_what_is_not_identified() -> None:
    arm = random_arm('RRR')
    assert 'do not identify' not in ' '.join(header_lines(arm))
    marked = header_lines(replace(arm, summary=deviations(offset_std_m=[0.0, 2.0, 0.0])))
    (row,) = [line for line in marked if line.startswith('joint_2')]
    assert row.endswith('?')
    assert row.count('?') == 1
    assert '? marks a number that the data do not identify' in ' '.join(marked)
    assert max(map(len, marked)) <= 100


@pytest.mark.parametrize('wrong', [[0.0], [[0.0] * 3] * 3])
def test_deviations_of_another_arm_are_refused(wrong: Any) -> None:
    arm = random_arm('RRR')
    with pytest.raises(ValueError, match=r'shape|inhomogeneous'):
        kinematics_of(arm.joint_names, arm.chain, deviations(length_std_m=wrong))
