"""Fixtures of the tests on real nodes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from nodes import toy
import pytest

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Graph


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[tuple[Graph, Client]]:
    """Give a ROS domain to start nodes in, and a client."""
    from nodes.ros_graph import graph  # only where ROS is there

    with graph(tmp_path) as made:
        yield made


@pytest.fixture(scope='session')
def model_path(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Model of the two pendulums."""
    path = tmp_path_factory.mktemp('model') / 'model.npz'
    toy.model().save(path)
    return str(path)


@pytest.fixture(scope='session')
def foreign_model_path(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Model of an arm with joints of other names."""
    path = tmp_path_factory.mktemp('model') / 'foreign.npz'
    toy.model(('left', 'right')).save(path)
    return str(path)
