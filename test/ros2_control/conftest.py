"""Fixtures of the tests with a real controller manager."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from nodes import toy
import pytest

if TYPE_CHECKING:
    from ros2_control.arm import Control


@pytest.fixture(scope='session')
def model_path(tmp_path_factory: pytest.TempPathFactory) -> str:
    return toy.model_path(tmp_path_factory)


@pytest.fixture(scope='session')
def control(tmp_path_factory: pytest.TempPathFactory, model_path: str) -> Iterator[Control]:
    """
    Give a controller manager of the toy arm, and a `serve` that fills plans for it.

    Its controllers: `arm` takes efforts, `arm_both` positions and efforts, `arm_position`
    positions, `arm_partial` efforts of some of the joints, `arm_wrong` what none takes;
    `arm_once` is as `arm`.

    """
    # only where ROS is there
    from ros2_control.arm import (
        BROADCASTER,
        controlled,
        LIMIT_S,
        RATE_HZ,
    )

    from benchmarks._mock_controller import JTC, trajectory_controller, write_parameters

    folder = tmp_path_factory.mktemp('ros2_control')
    broadcaster = {'joints': list(toy.JOINTS), 'interfaces': ['position', 'velocity', 'effort']}
    parameters = write_parameters(
        folder / 'controllers.yaml',
        RATE_HZ,
        {
            BROADCASTER: ('joint_state_broadcaster/JointStateBroadcaster', broadcaster),
            'arm': (JTC, trajectory_controller(toy.JOINTS)),
            'arm_both': (JTC, trajectory_controller(toy.JOINTS, ['position', 'effort'])),
            'arm_position': (JTC, trajectory_controller(toy.JOINTS, ['position'])),
            'arm_once': (JTC, trajectory_controller(toy.JOINTS)),
            'arm_wrong': (JTC, trajectory_controller(toy.JOINTS, ['velocity', 'effort'])),
            'arm_partial': (
                JTC,
                trajectory_controller(toy.JOINTS, allow_partial_joints_goal=True),
            ),
        },
    )
    with controlled(folder, parameters, toy.JOINTS) as made:
        made.graph.start_with(
            'serve',
            [
                *('-p', f'model_path:={model_path}', '-p', f'torque_limits:=[{toy.LIMIT}]'),
                *('-p', 'ramp_s:=0.0', '-p', 'stale_timeout_s:=0.0'),
                *('-p', 'controller_action:=/arm/follow_joint_trajectory'),
                *(
                    '-p',
                    'follow_controller:=true',
                    '-r',
                    '~/controller_state:=/arm/controller_state',
                ),
                *('-r', '~/trajectory_with_effort:=/arm/joint_trajectory'),
            ],
        )
        assert made.load(BROADCASTER)
        assert made.switch([BROADCASTER])
        made.client.status('serve', lambda status: status['state'] == 'active')
        made.client.limit_s, made.served = LIMIT_S, 'arm'
        yield made
