"""Exported arms, read by pinocchio, MuJoCo and a C compiler, against torques evaluated here."""

from __future__ import annotations

from dataclasses import replace
import importlib.util
import shutil

from export.arms import arm_of, COUPLED, random_arm
import numpy as np
import pytest

from lip_id_ros.errors import LipIdError, ModelError
from lip_id_ros.export.arm import ArmDescription, Exported
from lip_id_ros.export.check import Agreement, COMPILERS
from lip_id_ros.export.formats import FORMATS, formatted
from lip_id_ros.rigid_body.chain import ROTOR, STANDARD_GRAVITY

pytest.importorskip('pinocchio')
ARMS = ('panda', 'RPRPRR', 'PPR', 'PRP', 'R', 'P')
MISSING = {
    'urdf': False,
    'mjcf': importlib.util.find_spec('mujoco') is None,
    'c': not any(map(shutil.which, COMPILERS)),
}
EACH_FORMAT = pytest.mark.parametrize(
    'name',
    [
        pytest.param(name, marks=pytest.mark.skipif(MISSING[name], reason='reader is missing'))
        for name in FORMATS
    ],
)


def agreement(name: str, arm: ArmDescription, count: int = 10_000) -> Agreement:
    states = arm.ranges.random_states(count, np.random.default_rng(1))
    form = FORMATS[name]
    return form.check(form.text(arm), arm, arm.torque(*states), states)


@EACH_FORMAT
@pytest.mark.parametrize('arm', ARMS)
def test_readers_give_the_torques_of_the_arm(arm: str, name: str) -> None:
    found = agreement(name, arm_of(arm))
    assert found.difference.max() < 1e-12
    assert found.n_states == 10_000


@pytest.mark.parametrize('name', ['mjcf', 'c'])
def test_formats_that_have_coupled_positions(name: str) -> None:
    pytest.importorskip('mujoco')
    assert agreement(name, arm_of(COUPLED)).difference.max() < 1e-12


def test_urdf_has_no_coupled_positions() -> None:
    arm = arm_of(COUPLED)
    with pytest.raises(ModelError, match=r'coupled \(joint_3 -1 joint_2, joint_4 0.5 joint_3, '):
        formatted('urdf', Exported(arm, arm, None))


@EACH_FORMAT
def test_an_arm_without_gravity_stays_one(name: str) -> None:
    arm = random_arm('RRP')
    chain = arm.chain._replace(gravity=np.zeros(3))
    assert agreement(name, replace(arm, chain=chain)).difference.max() < 1e-12


@EACH_FORMAT
@pytest.mark.parametrize('what', ['mass', 'rotor', 'coefficient', 'origin'])
def test_a_wrong_file_is_found(name: str, what: str) -> None:
    arm = random_arm('RRR')
    links, chain = arm.links.copy(), arm.chain
    coefficients = arm.friction.coefficients.copy()
    if what == 'mass':
        links[2, 0] *= 1.001
    elif what == 'rotor':
        links[1, ROTOR] += 1e-3
    elif what == 'coefficient':
        coefficients[0] += 1e-3  # viscous, which all formats can express
    else:
        translations = chain.translations + np.array([[0.0], [1e-3], [0.0]])
        chain = chain._replace(translations=translations)
    friction = replace(arm.friction, coefficients=coefficients)
    wrong = replace(arm, links=links, chain=chain, friction=friction)
    states = arm.ranges.random_states(50, np.random.default_rng(1))
    form = FORMATS[name]
    found = form.check(form.text(wrong), arm, arm.torque(*states), states)
    assert found.difference.max() > 1e-6
    with pytest.raises(ModelError, match=r'was to give the same torques to 1e-09, but'):
        found.require(1e-9)


@EACH_FORMAT
def test_what_a_format_cannot_express_is_named(name: str) -> None:
    left_out = {part.term.name for part in agreement(name, arm_of('panda'), 10).left_out}
    common = {'offset', 'Stribeck', 'asymmetric', 'Coulomb', 'periodic twice a turn'}
    common |= {'load-dependent Coulomb', 'load-dependent viscous', 'position-dependent Coulomb'}
    common |= {'saturating viscous', 'torque', 'friction', 'pre-sliding', 'lag'}
    common |= {'curve over position', 'curve over velocity', 'Dahl hysteresis', 'lever spring'}
    expected = {
        'urdf': common | {'quadratic viscous', 'joint spring'},
        'mjcf': common,
        'c': set(),
    }
    assert left_out == expected[name]
    text = FORMATS[name].text(arm_of('panda'))
    flat = ' '.join(text.replace('*', ' ').split())
    for term in left_out - {'Coulomb'}:
        assert f'{term} (' in flat
    if name != 'c':
        assert 'coupled Coulomb (joint_7 with joint_6)' in flat


@EACH_FORMAT
def test_the_check_says_how_much_friction_a_file_lacks(name: str) -> None:
    arm = random_arm('RRR')
    states = arm.ranges.random_states(50, np.random.default_rng(1))
    tau = arm.torque(*states)
    form = FORMATS[name]
    found = form.check(form.text(arm), arm, tau, states)
    if form.friction is None:
        assert not found.lacking.any()
        assert 'lacks' not in found.sentence('the model')
        return
    left_out = {id(part) for part in found.left_out}
    kept = arm.friction.with_terms([id(x) not in left_out for x in arm.friction.basis.terms])
    missing = np.abs(tau - replace(arm, friction=kept).torque(*states)).max(axis=0)
    lacking = missing / np.abs(tau).max(axis=0)
    np.testing.assert_allclose(found.lacking, lacking, atol=1e-12)
    worst = int(lacking.argmax())
    said = f'up to {100.0 * lacking[worst]:.2g} % of the largest torque at joint_{worst + 1}.'
    assert said in found.sentence('the model')


@EACH_FORMAT
def test_gravity_is_said_where_there_is_some(name: str) -> None:
    arm = random_arm('RR')
    chain = arm.chain._replace(gravity=np.zeros(3))
    floating = replace(arm, chain=chain)
    said, unsaid = (FORMATS[name].text(x).replace('*', ' ').split() for x in (arm, floating))
    at = said.index('Gravity')
    vector = [float(x) for x in said[at + 2 : at + 5]]
    np.testing.assert_allclose(vector, arm.chain.gravity, atol=1e-6)
    assert said[at + 5 : at + 7] == ['m/s^2', 'in']
    assert 'Gravity' not in unsaid
    chain = chain._replace(gravity=np.array([0.0, 0.0, -STANDARD_GRAVITY]))
    sentence = agreement(name, replace(arm, chain=chain), 2).sentence('the model')
    assert 'a gravity of 9.80665 m/s^2' in sentence


@EACH_FORMAT
def test_a_missing_reader_is_named(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = random_arm('RR')
    text = FORMATS[name].text(arm)
    states = arm.ranges.random_states(2, np.random.default_rng(1))
    monkeypatch.setitem(__import__('sys').modules, 'pinocchio', None)
    monkeypatch.setitem(__import__('sys').modules, 'mujoco', None)
    monkeypatch.setenv('PATH', '')
    with pytest.raises(LipIdError, match='install'):
        FORMATS[name].check(text, arm, arm.torque(*states), states)
