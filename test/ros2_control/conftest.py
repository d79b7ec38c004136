"""Fixtures of the tests with a real controller manager."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from nodes import toy
import pytest

if TYPE_CHECKING:
    from ros2_control.arm import Control


@pytest.fixture(scope='session')
def model_path(tmp_path_factory: pytest.TempPathFactory) -> str:
    return toy.model_path(tmp_path_factory)


@pytest.fixture(scope='session')
def parameters(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """
    Parameters of a controller manager and its controllers.

    `arm` takes efforts, `arm_both` positions and efforts, `arm_position` positions, `arm_partial`
    efforts of some of the joints, `arm_wrong` what none takes; `arm_once` is as `arm`.

    """
    # only where ROS is there
    from ros2_control.arm import BROADCASTER, RATE_HZ

    from benchmarks._mock_controller import JTC, trajectory_controller, write_parameters

    broadcaster = {'joints': list(toy.JOINTS), 'interfaces': ['position', 'velocity', 'effort']}
    return write_parameters(
        tmp_path_factory.mktemp('ros2_control') / 'controllers.yaml',
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


@pytest.fixture(scope='session')
def control(parameters: Path, model_path: str) -> Iterator[Control]:
    """Give a controller manager of the toy arm, and a `serve` that fills plans for it."""
    from ros2_control.arm import served

    with served(parameters.parent, parameters, model_path) as made:
        yield made
