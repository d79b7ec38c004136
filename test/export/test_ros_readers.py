"""The URDF, read by libraries of the ROS in use: urdfdom, kdl_parser and KDL."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import subprocess
import xml.etree.ElementTree as ET

from export.arms import arm_of, panda, random_arm
from export.readers import states_of
import numpy as np
import pytest
from ros_libraries import built
import yaml

from lip_id_ros.arrays import Array
from lip_id_ros.export.urdf import to_urdf
from lip_id_ros.rigid_body import STANDARD_GRAVITY
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.regressor import torque_regressor

pinocchio = pytest.importorskip('pinocchio')
HERE = Path(__file__).parent
CONFIG = HERE.parents[1] / 'config'


def test_urdfdom_reads_it(tmp_path: Path) -> None:
    program = built(HERE / 'parse_urdf.cpp', tmp_path, 'urdfdom_model')
    text, file = to_urdf(random_arm('RPRRRRR')), tmp_path / 'arm.urdf'
    for content, status in ((text, 0), (text.replace('type=', 'kind='), 1)):
        file.write_text(content)
        ran = subprocess.run([program, file], capture_output=True, check=False)
        assert ran.returncode == status, ran.stderr


class Solver:
    """What kdl_inverse_dynamics_solver calls: the chain of a URDF, then M, C and g of KDL."""

    def __init__(self, text: str, folder: Path, root: str, tip: str, gravity: Array) -> None:
        self._folder, urdf = folder, folder / 'arm.urdf'
        urdf.write_text(text)
        program = built(HERE / 'kdl_solver.cpp', folder, 'kdl_parser', 'orocos-kdl')
        numbers = [repr(float(value)) for value in gravity]
        self._command = [str(program), str(urdf), root, tip, *numbers]

    def torque(self, states: Array) -> Array:
        n = states.shape[2]
        rows = folded(states)
        np.savetxt(self._folder / 'states.txt', rows, fmt='%.17g')
        with open(self._folder / 'states.txt') as file:
            ran = subprocess.run(
                [*self._command, str(n)], stdin=file, capture_output=True, text=True, check=False
            )
        assert ran.returncode == 0, ran.stderr
        return np.array(ran.stdout.split(), dtype=np.float64).reshape(-1, n)


def folded(states: Array) -> Array:
    """Return q, dq, ddq of (3, N, n) side by side, (N, 3 n)."""
    return np.hstack(list(states))


@pytest.mark.parametrize('name', ['panda', 'RPRPRR', 'PRP', 'P'])
def test_kdl_gives_the_torques_of_the_links(name: str, tmp_path: Path) -> None:
    """Without friction and rotors, which it does not know."""
    arm = arm_of(name)
    tip = f'{arm.joint_names[-1]}_link'
    solver = Solver(to_urdf(arm), tmp_path, 'base_link', tip, arm.chain.gravity)
    states = states_of(arm, 1000)
    expected = torque_regressor(arm.chain, *states) @ arm.links.ravel()
    expected -= arm.links[:, ROTOR] * states[2]
    difference = np.abs(solver.torque(states) - expected).max(axis=0)
    assert (difference / np.abs(expected).max(axis=0)).max() < 1e-12


def example() -> tuple[str, str, Array]:
    """Return root, tip and gravity of config/inverse_dynamics_solver.yaml."""
    content = yaml.safe_load((CONFIG / 'inverse_dynamics_solver.yaml').read_text())
    parameters = content['/**']['ros__parameters']['kdl']
    return parameters['root'], parameters['tip'], np.array(parameters['gravity'])


def test_gravity_with_the_example_of_a_solver(tmp_path: Path) -> None:
    """Its links are in the file, its gravity is the arm's."""
    root, tip, gravity = example()
    controllers = yaml.safe_load((CONFIG / 'controllers.yaml').read_text())
    names = tuple(controllers['arm_controller']['ros__parameters']['joints'])
    chain = panda().chain._replace(gravity=np.array([0.0, 0.0, -STANDARD_GRAVITY]))
    arm = replace(panda(), joint_names=names, chain=chain)
    text = to_urdf(arm)
    links = [link.get('name') for link in ET.fromstring(text).findall('link')]
    assert [root, tip] == [links[0], links[-1]]
    states = states_of(arm, 20)
    states[1:] = 0.0
    expected = torque_regressor(arm.chain, *states) @ arm.links.ravel()
    model = pinocchio.buildModelFromXML(text)
    model.gravity.linear = gravity
    data = model.createData()
    found = [pinocchio.computeGeneralizedGravity(model, data, q).copy() for q in states[0]]
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)
    solver = Solver(text, tmp_path, root, tip, gravity)
    np.testing.assert_allclose(solver.torque(states), expected, rtol=1e-10, atol=1e-10)
