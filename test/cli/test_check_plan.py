"""The verb that compares the torques of a plan with limits."""

from __future__ import annotations

import json
from pathlib import Path

from cli.conftest import Capture, lip_id, Workshop
import numpy as np
import pytest

from lip_id_ros.cli import main
from lip_id_ros.excitation.trajectory_file import Trajectory, write_bag, write_yaml
from lip_id_ros.feedforward.interpolation import Plan
from lip_id_ros.feedforward.plan_check import check_plan
from lip_id_ros.model import InverseDynamicsModel

JOINTS = ('wrist', 'shoulder', 'elbow')  # not in the order of the model


def trajectory() -> Trajectory:
    states = np.zeros((3, 2, 3))
    states[0, 1] = [0.3, 0.5, -0.4]
    return Trajectory(JOINTS, np.array([0.0, 0.5]), *states)


@pytest.fixture
def largest(workshop: Workshop, here: Path) -> list[float]:
    """Write the plan, and return its largest torques."""
    made = trajectory()
    write_yaml('plan.yaml', made)
    model = InverseDynamicsModel.load(workshop.model)
    plan = Plan(JOINTS, made.t, np.stack(made[2:]))
    return [abs(load.tau) for load in check_plan(model, plan, [1e6]).loads]


def listed(values: list[float]) -> str:
    return ','.join(map(repr, values))


def urdf(limits: list[float]) -> str:
    joints = [
        f'<joint name="{joint}" type="revolute"><parent link="l{n}"/><child link="l{n + 1}"/>'
        f'<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="9" effort="{limit!r}"/></joint>'
        for n, (joint, limit) in enumerate(
            zip(('shoulder', 'elbow', 'wrist'), limits, strict=True)
        )
    ]
    links = ''.join(f'<link name="l{n}"/>' for n in range(4))
    return f'<robot name="arm">{links}{"".join(joints)}</robot>'


def test_a_plan_that_fits(
    workshop: Workshop, here: Path, largest: list[float], capsys: Capture
) -> None:
    limits = [1.01 * each for each in largest]
    lip_id('check-plan', workshop.model, 'plan.yaml', '--limits', listed(limits))
    shown = capsys.readouterr().out
    assert 'The plan fits.' in shown
    assert all(joint in shown for joint in JOINTS)
    assert '99.0' in shown  # % of the limit


def test_a_plan_that_does_not_fit(
    workshop: Workshop, here: Path, largest: list[float], capsys: Capture
) -> None:
    limits = [0.9 * largest[0], *(2.0 * each for each in largest[1:])]
    arguments = ['check-plan', str(workshop.model), 'plan.yaml', '--limits', listed(limits)]
    assert main([*arguments, '--json', 'check.json']) == 1
    shown = capsys.readouterr()
    assert 'The plan does not fit. It does in 1.' in shown.out
    assert 'the plan of plan.yaml must stay within the limits of all joints' in shown.err
    (check,) = json.loads((here / 'check.json').read_text())['plans']
    assert not check['fits']
    assert 1.0 < check['scale'] < 2.0
    first, *others = check['joints']
    assert first['joint'] == 'shoulder'
    assert first['excess'] == pytest.approx(0.1 * largest[0])
    assert first['beyond_s']
    assert not any(each['beyond_s'] for each in others)


def test_a_plan_without_velocities_gets_a_caution(
    workshop: Workshop, here: Path, largest: list[float], capsys: Capture
) -> None:
    point = '{positions: [0, 0, 0], time_from_start: {sec: %d}}'
    points = f'points: [{point % 1}, {point % 2}]'
    (here / 'bare.yaml').write_text(f'joint_names: [{", ".join(JOINTS)}]\n{points}\n')
    arguments = ['--limits', '1e6', '--json', 'check.json', '--force']
    lip_id('check-plan', workshop.model, 'bare.yaml', *arguments)
    shown = ' '.join(capsys.readouterr().out.split())
    assert '2 of 2 points have no velocities' in shown
    assert 'torques of inertia are missing' in shown
    (check,) = json.loads((here / 'check.json').read_text())['plans']
    assert check['caution'].startswith('2 of 2 points')
    lip_id('check-plan', workshop.model, 'plan.yaml', *arguments)
    assert 'no velocities' not in capsys.readouterr().out


def test_limits_of_a_urdf_and_of_serve(
    workshop: Workshop, here: Path, largest: list[float]
) -> None:
    limits = [2.0 * each for each in largest]
    write_bag('plan.mcap', trajectory())
    (here / 'arm.urdf').write_text(urdf(limits))
    reversed_limits = ', '.join(map(repr, limits[::-1]))
    (here / 'serve.yaml').write_text(
        '/**/serve:\n  ros__parameters:\n    joints: [wrist, elbow, shoulder]\n'
        f'    torque_limits: [{reversed_limits}]\n'
    )
    for option in (['--urdf', 'arm.urdf'], ['--params', 'serve.yaml']):
        lip_id('check-plan', workshop.model, 'plan.mcap', *option, '--json', 'check.json')
        (check,) = json.loads((here / 'check.json').read_text())['plans']
        np.testing.assert_allclose([each['limit'] for each in check['joints']], limits)


def test_every_plan_of_a_file_is_checked(
    workshop: Workshop, here: Path, largest: list[float], capsys: Capture
) -> None:
    text = (here / 'plan.yaml').read_text()
    slow = text.replace('sec: 0, nanosec: 500000000', 'sec: 9, nanosec: 0')
    (here / 'plans.yaml').write_text(f'{slow}---\n{text}')
    limits = listed([0.9 * each for each in largest])
    assert main(['check-plan', str(workshop.model), 'plans.yaml', '--limits', limits]) == 1
    shown = capsys.readouterr()
    assert 'Plan 1 of 2, 9 s' in shown.out
    assert 'plans 2 of plans.yaml must stay' in shown.err or 'plans 1, 2 of' in shown.err


def test_a_weight_that_is_too_large(
    workshop: Workshop, here: Path, largest: list[float], capsys: Capture
) -> None:
    arguments = ['check-plan', str(workshop.model), 'plan.yaml', '--limits', '1e-6']
    assert main(arguments) == 1
    assert 'does not fit, not in 10 times its time either' in capsys.readouterr().out


@pytest.mark.parametrize(
    'limits', ['torque_limits: []', 'torque_limits_from: none', 'joints: [shoulder]']
)
def test_parameters_without_numbers(
    workshop: Workshop, here: Path, largest: list[float], capsys: Capture, limits: str
) -> None:
    (here / 'serve.yaml').write_text(f'/**/serve:\n  ros__parameters:\n    {limits}\n')
    assert main(['check-plan', str(workshop.model), 'plan.yaml', '--params', 'serve.yaml']) == 1
    assert 'torque_limits in serve.yaml must be numbers here' in capsys.readouterr().err


@pytest.mark.parametrize(
    'option', [['--limits', '1,x'], ['--limits', '0'], ['--sigmas', '-1'], []]
)
def test_wrong_usage(option: list[str], capsys: Capture) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(['check-plan', 'arm.npz', 'plan.yaml', *option])
    assert stopped.value.code == 2
