"""Fixtures of the tests on real nodes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from nodes import toy
import pytest

from lip_id_ros.model import InverseDynamicsModel

if TYPE_CHECKING:
    from nodes.ros_graph import Ros


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[Ros]:
    from nodes.ros_graph import graph  # only where ROS is there

    with graph(tmp_path) as made:
        yield made


@pytest.fixture(scope='session')
def shared(tmp_path_factory: pytest.TempPathFactory, model_path: str) -> Iterator[Ros]:
    """Start `serve` once for many tests; each answer is the model's own, none comes unasked."""
    from nodes.ros_graph import graph  # only where ROS is there

    with graph(tmp_path_factory.mktemp('shared')) as (made, client):
        made.start(
            'serve',
            model_path=model_path,
            ramp_s=0.0,
            stale_timeout_s=0.0,
            torque_limits=[toy.LIMIT],
            refine_plans=False,
        )
        client.status('serve', lambda status: status['state'] == 'active')
        yield made, client


@pytest.fixture
def serving(shared: Ros, model_path: str) -> Ros:
    """Give the shared `serve` as it was at its start, with counts from now on."""
    _, client = shared
    results = client.set_parameters(
        'serve',
        enabled=True,
        gravity=True,
        model_path=model_path,
        rate_limits=[],
        residual_cutoff_hz=4.0,
        torque_limits=[toy.LIMIT],
    )
    assert all(result.successful for result in results)
    client.mark('serve')
    return shared


@pytest.fixture(scope='session')
def model_path(tmp_path_factory: pytest.TempPathFactory) -> str:
    return toy.model_path(tmp_path_factory)


@pytest.fixture(scope='session')
def foreign_model_path(tmp_path_factory: pytest.TempPathFactory, model_path: str) -> str:
    path = tmp_path_factory.mktemp('model') / 'foreign.npz'
    replace(InverseDynamicsModel.load(model_path), joint_names=('left', 'right')).save(path)
    return str(path)
