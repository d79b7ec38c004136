"""Exported arms, read by pinocchio, MuJoCo and a C compiler, against torques evaluated here."""

from __future__ import annotations

from dataclasses import replace

from export.arms import arm_of, COUPLED, describe, model_of, random_arm
from export.readers import difference, EACH_FORMAT, MISSING, READERS, states_of
import numpy as np
import pytest

from benchmarks._zoo import load_arm, ZOO
from lip_id_ros.errors import LipIdError, ModelError
from lip_id_ros.export.arm import ArmDescription, Exported
from lip_id_ros.export.formats import FORMATS, formatted
from lip_id_ros.export.text import split_friction
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.simulation.arm import panda_urdf

pytest.importorskip('pinocchio')
ARMS = ('panda', 'RPRPRR', 'PPR', 'PRP', 'R', 'P')


def of_zoo(name: str) -> ArmDescription:
    """Return an arm of the zoo with rotors, and with friction of every kind."""
    found = ZOO[name]
    urdf = panda_urdf().parents[2] / found.urdf
    description = load_arm(urdf, found.first, found.last).description
    links = description.links.copy()
    links[:, ROTOR] = 0.1
    return describe(name.replace(', ', '_'), description.chain, links)


def error(name: str, arm: ArmDescription, count: int = 1000) -> float:
    """Return the largest difference between what an arm's file gives, and its model."""
    states = states_of(arm, count)
    tau = model_of(arm).predict(*states).tau
    return difference(name, FORMATS[name].text(arm), arm, states, tau)


@EACH_FORMAT
@pytest.mark.parametrize('arm', ARMS)
def test_readers_give_the_torques_of_the_arm(arm: str, name: str) -> None:
    assert error(name, arm_of(arm)) < 1e-12


@EACH_FORMAT
@pytest.mark.parametrize('arm', ['UR10', 'xArm7', 'TIAGo, torso'])
def test_readers_give_the_torques_of_robots(arm: str, name: str) -> None:
    assert error(name, of_zoo(arm)) < 1e-9


@pytest.mark.parametrize('name', ['mjcf', 'c'])
def test_formats_that_have_coupled_positions(name: str) -> None:
    if MISSING[name]:
        pytest.skip('reader is missing')
    assert error(name, arm_of(COUPLED)) < 1e-12


def test_urdf_has_no_coupled_positions() -> None:
    arm = arm_of(COUPLED)
    with pytest.raises(ModelError, match=r'coupled \(joint_3 -1 joint_2, joint_4 0.5 joint_3, '):
        formatted('urdf', Exported(arm, arm, None))


@EACH_FORMAT
def test_an_arm_without_gravity_stays_one(name: str) -> None:
    arm = random_arm('RRP')
    chain = arm.chain._replace(gravity=np.zeros(3))
    assert error(name, replace(arm, chain=chain)) < 1e-12


@EACH_FORMAT
@pytest.mark.parametrize('what', ['mass', 'rotor', 'coefficient', 'origin'])
def test_every_number_of_a_file_counts(name: str, what: str) -> None:
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
    wrong = FORMATS[name].text(replace(arm, links=links, chain=chain, friction=friction))
    states = states_of(arm, 50)
    assert difference(name, wrong, arm, states, arm.torque(*states)) > 1e-6


@pytest.mark.parametrize('name', READERS)
def test_what_a_format_cannot_express_is_named(name: str) -> None:
    expressed, left_out = FORMATS[name].friction, set[str]()
    if expressed is not None:
        terms = split_friction(arm_of('panda'), expressed).left_out.basis.terms
        left_out = {part.term.name for part in terms}
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


@pytest.mark.parametrize('name', READERS)
def test_gravity_is_said_where_there_is_some(name: str) -> None:
    arm = random_arm('RR')
    floating = replace(arm, chain=arm.chain._replace(gravity=np.zeros(3)))
    said, unsaid = (FORMATS[name].text(x).replace('*', ' ').split() for x in (arm, floating))
    at = said.index('Gravity')
    vector = [float(x) for x in said[at + 2 : at + 5]]
    np.testing.assert_allclose(vector, arm.chain.gravity, atol=1e-6)
    assert said[at + 5 : at + 7] == ['m/s^2', 'in']
    assert 'Gravity' not in unsaid


def test_a_missing_mujoco_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__('sys').modules, 'mujoco', None)
    with pytest.raises(LipIdError, match='install'):
        FORMATS['mjcf'].text(random_arm('RR'))
