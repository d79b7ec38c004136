"""What `serve` does with a message, without ROS."""

from __future__ import annotations

from array import array
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
import pytest

from lip_id_ros.runtime.feedforward import Answer, Feedforward
from lip_id_ros.runtime.limits import TorqueLimits
from lip_id_ros.runtime.references import Point, Reason, RefusedError
from lip_id_ros.runtime.server import Server

Array = NDArray[np.float64]
NAMES = ('a', 'b')


@dataclass
class Sum:
    """A robot whose torques are q + 10 dq + 100 ddq."""

    factor: float = 1.0

    def query(self, q: Array, dq: Array, ddq: Array) -> Answer:
        return Answer(self.factor * (q + 10 * dq + 100 * ddq), float(dq @ dq), np.nan)

    def predict(self, q: Array, dq: Array, ddq: Array) -> Any:
        return SimpleNamespace(tau=self.factor * (q + 10 * dq + 100 * ddq))


def point(q: list[float], dq: list[float], ddq: list[float]) -> Point:
    arrays = (array('d', values) for values in (q, dq, ddq))
    return SimpleNamespace(
        **dict(zip(('positions', 'velocities', 'accelerations'), arrays, strict=True))
    )


POINT = point([1, 2], [3, 4], [5, 6])


@pytest.fixture
def server() -> Server:
    server = Server()
    server.use(Feedforward(Sum(), NAMES), TorqueLimits([1000.0, 600.0], 1.0))
    server.enabled = True
    return server


def test_sample_is_answered_in_the_order_of_the_model(server: Server) -> None:
    answer = server.sample(['b', 'tool', 'a'], [point([2, 9, 1], [4, 9, 3], [6, 9, 5])])
    np.testing.assert_array_equal(answer.tau, [531.0, 600.0])
    assert answer.kinetic == 25.0
    assert server.status()['answered'] == {'samples': 1, 'plans': 0}
    assert server.status()['limited'] == 1


def test_plan_is_answered_in_the_order_of_its_message(server: Server) -> None:
    tau = server.plan(['b', 'a'], [point([2, 1], [4, 3], [6, 5]), point([0, 1], [0, 0], [0, 0])])
    np.testing.assert_array_equal(tau, [[600.0, 531.0], [0.0, 1.0]])
    assert server.status()['answered'] == {'samples': 0, 'plans': 1}


def test_plan_with_a_foreign_joint_is_refused_and_counted(server: Server) -> None:
    with pytest.raises(RefusedError, match='one is not in the model'):
        server.plan(['a', 'b', 'tool'], [point([1] * 3, [1] * 3, [1] * 3)] * 2)
    assert server.status()['refused'] == {Reason.FOREIGN_JOINT: 1}


def test_torque_that_is_not_finite_never_leaves(server: Server) -> None:
    server.use(Feedforward(Sum(np.nan), NAMES), TorqueLimits([np.inf, np.inf], 1.0))
    for answer in (server.sample, server.plan):
        with pytest.raises(RefusedError, match='not finite'):
            answer(NAMES, [POINT])
    assert server.status()['refused'] == {Reason.NOT_FINITE_TORQUE: 2}
    assert server.status()['answered'] == {'samples': 0, 'plans': 0}


def test_nothing_is_answered_while_disabled_or_inactive(server: Server) -> None:
    server.enabled = False
    with pytest.raises(RefusedError, match='call its service enable'):
        server.sample(NAMES, [POINT])
    server.release()
    assert not server.active
    with pytest.raises(RefusedError, match='activate it through its lifecycle'):
        server.sample(NAMES, [POINT])
    assert server.status()['refused'] == {Reason.DISABLED: 1, Reason.INACTIVE: 1}
    assert server.n_refused == 2


def test_counts_outlive_a_change_of_model(server: Server) -> None:
    server.sample(NAMES, [POINT])
    server.use(Feedforward(Sum(2.0), NAMES), TorqueLimits([np.inf, np.inf], 0.5))
    np.testing.assert_array_equal(server.sample(NAMES, [POINT]).tau, [531.0, 642.0])
    assert server.status()['answered'] == {'samples': 2, 'plans': 0}
