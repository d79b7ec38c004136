"""Arms of the zoo: what their URDFs say, what is simulated, and the rows of the page."""

from __future__ import annotations

import json
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from benchmarks import zoo
from benchmarks._arms import with_gravity
from benchmarks._results import Row
from benchmarks._zoo import (
    load_arm,
    MOTIONS,
    NOISE,
    PERIOD_S,
    RATE_HZ,
    recorded,
    SerialArm,
    ZOO,
    ZooArm,
)
from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError, LipIdError
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.rigid_body import STANDARD_GRAVITY
from lip_id_ros.simulation.arm import panda_urdf, SimulatedArm

LINK = """
<link name="{name}"><inertial><origin xyz="0.03 0.1 0.2"/><mass value="{mass}"/>
<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0.002" izz="0.01"/></inertial></link>
"""
JOINT = """
<joint name="{name}" type="{type}"><parent link="{parent}"/><child link="{child}"/>
<origin xyz="0.1 0 0.3" rpy="0.4 0.2 0"/><axis xyz="{axis}"/>{limit}</joint>
"""
BODIES = ''.join(
    LINK.format(name=name, mass=mass)
    for name, mass in (('base', 5), ('lift', 4), ('plate', 1), ('upper', 2), ('fore', 1.5))
)
URDF = f"""<robot name="tiny">{BODIES}
{
    JOINT.format(
        name='slide',
        type='prismatic',
        parent='base',
        child='lift',
        axis='0 0 1',
        limit='<limit lower="0" upper="0.4" velocity="0.07" effort="9"/>',
    )
}
{JOINT.format(name='bolt', type='fixed', parent='lift', child='plate', axis='0 0 1', limit='')}
{
    JOINT.format(
        name='shoulder',
        type='revolute',
        parent='plate',
        child='upper',
        axis='0 1 0',
        limit='<limit lower="-1" upper="3" velocity="99" effort="9"/>',
    )
}
{
    JOINT.format(
        name='elbow', type='continuous', parent='upper', child='fore', axis='1 0 0', limit=''
    )
}
</robot>"""
NAMES = ('slide', 'shoulder', 'elbow')


@pytest.fixture
def robots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one robot, which is all of the zoo."""
    (tmp_path / 'tiny.urdf').write_text(URDF)
    monkeypatch.setattr(zoo, 'ZOO', {'tiny': ZooArm('tiny.urdf', 'slide', 'elbow')})
    return tmp_path


@pytest.fixture(scope='module')
def arm(tmp_path_factory: pytest.TempPathFactory) -> SerialArm:
    path = tmp_path_factory.mktemp('urdf') / 'tiny.urdf'
    path.write_text(URDF)
    return load_arm(path, 'slide', 'elbow')


def test_an_arm_is_what_lies_between_two_joints(arm: SerialArm, tmp_path: Path) -> None:
    assert arm.description.joint_names == NAMES
    assert arm.description.joint_types == ('prismatic', 'revolute', 'revolute')
    np.testing.assert_allclose(arm.limits.q_min, [0.02, -0.8, -2.5])
    np.testing.assert_allclose(arm.limits.q_max, [0.38, 2.8, 2.5])
    np.testing.assert_allclose(arm.limits.dq_max, [0.07, 2.0, 2.0])
    (tmp_path / 'tiny.urdf').write_text(URDF)
    forearm = load_arm(tmp_path / 'tiny.urdf', 'elbow', 'elbow')
    assert forearm.description.joint_names == ('elbow',)
    with pytest.raises(DataError, match=r"joint 'slide' .* carried by joint 'elbow' in .*tiny"):
        load_arm(tmp_path / 'tiny.urdf', 'elbow', 'slide')


def test_torques_are_those_of_pinocchio_and_of_friction(arm: SerialArm, tmp_path: Path) -> None:
    pytest.importorskip('pinocchio')
    limit = '<axis xyz="1 0 0"/><limit lower="-3" upper="3" velocity="2" effort="9"/>'
    limited = URDF.replace('continuous', 'revolute').replace('<axis xyz="1 0 0"/>', limit)
    (tmp_path / 'tiny.urdf').write_text(limited)
    recording = recorded(arm, 'random', 3)
    train = recording.train
    assert train.tau_noiseless is not None
    rest = train.tau_noiseless - recording.friction.torque(train.dq)
    gravity = np.array([0.0, 0.0, -STANDARD_GRAVITY])
    other = with_gravity(SimulatedArm(tmp_path / 'tiny.urdf', 3), gravity)
    rest -= other.inverse_dynamics(train.q, train.dq, train.ddq)
    rotors = np.sum(rest * train.ddq, axis=0) / np.sum(train.ddq**2, axis=0)
    assert np.all(rotors > 0.0)
    np.testing.assert_allclose(rest, rotors * train.ddq, atol=1e-9)


@settings(max_examples=10)
@given(seed=st.integers(0, 2**31), motion=st.sampled_from(MOTIONS))
def test_a_recording_keeps_to_the_limits(arm: SerialArm, seed: int, motion: str) -> None:
    recording = recorded(arm, motion, seed)
    for data in (recording.train, recording.test):
        assert np.all((arm.limits.q_min <= data.q) & (data.q <= arm.limits.q_max))
        assert np.all(np.abs(data.dq) <= arm.limits.dq_max)
        assert np.all(recording.friction.torque(data.dq) * data.dq >= 0.0)
    truth = recording.train.tau_noiseless
    assert truth is not None
    noise = np.std(recording.train.tau - truth, axis=0)
    np.testing.assert_allclose(noise, NOISE * truth.std(axis=0), rtol=0.1)


def test_what_is_unseen_is_new_and_the_same_for_both_motions(arm: SerialArm) -> None:
    random, periodic = (recorded(arm, motion, 0) for motion in MOTIONS)
    np.testing.assert_array_equal(random.test.q, periodic.test.q)
    assert np.array_equal(random.friction.coulomb, periodic.friction.coulomb)
    period = round(PERIOD_S * RATE_HZ)
    assert repeats(periodic.train.q, period)
    assert not repeats(random.train.q, period)
    assert not repeats(random.test.q, period)
    assert np.abs(random.train.q - random.test.q).max() > 0.1


def repeats(q: Array, period: int) -> bool:
    """Whether a motion does the same after some samples."""
    return bool(np.allclose(q[period:], q[:-period], atol=1e-9))


def test_only_the_rival_that_knows_friction_is_exact(
    arm: SerialArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('benchmarks._zoo.NOISE', 0.0)
    recording = recorded(arm, 'random', 1)
    chain = arm.description.chain
    fixed, true = (
        nmse_percent(zoo.least_squares(chain, recording, rival), recording.test.tau)
        for rival in zoo.RIVALS
    )
    assert true.max() < 1e-9
    assert fixed.min() > 1e-4
    assert fixed.max() < 5.0


def test_rows_of_the_zoo_are_those_of_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zoo, 'ZOO', dict.fromkeys(('a', 'b', 'c')))
    rows: dict[str, Row] = {
        'a | random | 0 | articulated': _row([0.2, 0.8], [0.1, 0.4]),
        'a | random | 0 | fixed sign': _row([1.0, 1.0], [0.4, 0.4]),
        'a | random | 0 | true friction': _row([0.2, 0.2], [0.1, 0.1]),
        'a | random | 1 | articulated': _row([0.4, 0.4], [0.2, 0.2]),
        'a | random | 1 | fixed sign': _row([1.0, 1.0], [0.4, 0.4]),
        'a | random | 1 | true friction': _row([0.2, 0.2], [0.1, 0.1]),
        'a | periodic | 0 | articulated': _row([9.0, 9.0], [9.0, 9.0]),
        'b | random | 0 | articulated': {'error': 'of no use'},
    }
    cells = '0.4 | 1 | 0.2 | 0.40 | 2.00 | 0.2 | 0.4 | 0.1 | 0.50 | 2.00'
    expected = [f'| a | {cells} | 12 |', '| b | failed |', f'| all joints | {cells} |  |']
    assert list(zoo.table(rows, 'random', 'articulated')) == expected


def _row(measured: list[float], true: list[float]) -> Row:
    return {'nmse': true, 'nmse_measured': measured, 'cpu_s': 12.0}


def test_the_zoo_goes_on_where_it_was(robots: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Only what is missing is measured."""
    results = robots / 'zoo.json'
    known = {'tiny | random | 0 | articulated': _row([0.2] * 3, [0.1] * 3)}
    results.write_text(json.dumps(known))
    arguments = ['--robots', str(robots), '--results', str(results), '--motions', 'random']
    assert zoo.main(arguments) == 0
    rows = json.loads(results.read_text())
    assert len(rows) == 3
    assert known.items() <= rows.items()
    assert all(len(row['nmse']) == 3 for row in rows.values())
    assert '| tiny | 0.2 |' in capsys.readouterr().out


def test_an_arm_that_is_not_there_is_a_row_of_its_own(robots: Path) -> None:
    (robots / 'tiny.urdf').write_text(URDF.replace('elbow', 'knee'))
    arguments = ['--robots', str(robots), '--results', str(robots / 'zoo.json')]
    assert zoo.main([*arguments, '--motions', 'random']) == 0
    rows = json.loads((robots / 'zoo.json').read_text())
    assert all("joint 'elbow' was expected" in row['error'] for row in rows.values())


@pytest.mark.parametrize('name', ZOO)
def test_every_arm_is_there(name: str) -> None:
    try:
        robots = panda_urdf().parents[2]
    except LipIdError as error:
        pytest.skip(str(error))
    entry = ZOO[name]
    names = load_arm(robots / entry.urdf, entry.first, entry.last).description.joint_names
    assert (names[0], names[-1]) == (entry.first, entry.last)
    assert len(names) >= 3
