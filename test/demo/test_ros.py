# ruff: noqa: E402
"""What the demo reads back from its bag; the graph itself is run by `make demo`."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import numpy as np
from rclpy.serialization import serialize_message
from rosbags.serde import SerdeError
from rosbags.typesys import get_typestore, Stores
from std_msgs.msg import Float64

from examples.demo.served import (
    JOINT_STATES,
    KINETIC,
    make_plan,
    outcome_of,
    PLAN_WITH_EFFORT,
    POTENTIAL,
    read_served,
    REFERENCE,
    require_efforts,
    TOPICS,
    TORQUE,
)
from lip_id_ros.dataset import Dataset
from lip_id_ros.demo.nodes import measured_message, motion, reference_message, RobotSettings
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import score
from lip_id_ros.model import Prediction
from lip_id_ros.nodes import messages
from lip_id_ros.recording.bag_writer import RawBag

pytestmark = pytest.mark.ros
pytest.importorskip('pinocchio', reason='the simulated Panda needs pinocchio')

from lip_id_ros.simulation import panda

N = 20
STORE = get_typestore(Stores.ROS2_JAZZY)
START_NS = 1_700_000_000_000_000_000


class Silent:
    """A model that predicts zeros: the evaluated values must come from the bag."""

    joint_names, joint_types = panda().joint_names, panda().joint_types
    n_joints, size, has_potential = 7, 0, True

    def predict(self, q: Any, dq: Any, ddq: Any) -> Prediction:
        zero, still = np.zeros_like(q), np.zeros(len(q))
        return Prediction(zero, still, still, zero, zero, zero, zero)

    def inertia_matrix(self, q: Any) -> Any:
        return np.tile(np.eye(q.shape[1]), (len(q), 1, 1))


@pytest.fixture(scope='module')
def moved() -> tuple[Dataset, Dataset]:
    return motion(RobotSettings(seed=3, rate_hz=10.0))


def served_messages(exact: Dataset, measured: Dataset) -> dict[str, list[Any]]:
    assert exact.tau_noiseless is not None
    assert exact.kinetic is not None
    assert exact.potential is not None
    content: dict[str, list[Any]] = {topic: [] for topic in TOPICS}
    for row in range(N):
        stamp = messages.stamp_at(START_NS + row * 100_000_000)
        torque = messages.torque_message(stamp, exact.joint_names, exact.tau_noiseless[row])
        content[JOINT_STATES].append(measured_message(stamp, measured, row))
        content[REFERENCE].append(reference_message(stamp, exact, row))
        content[TORQUE].append(torque)
        content[KINETIC].append(Float64(data=float(exact.kinetic[row])))
        content[POTENTIAL].append(Float64(data=float(exact.potential[row]) + 7.0))
    plan = make_plan(1)
    content[REFERENCE].append(plan)
    filled = deepcopy(plan)
    for point in filled.points:
        point.effort = [0.0] * 7
    content[PLAN_WITH_EFFORT].append(filled)
    return content


def write(path: Path, content: Mapping[str, list[Any]]) -> Path:
    with RawBag(path, TOPICS) as bag:
        for topic, sent in content.items():
            for number, message in enumerate(sent):
                data = as_on_the_wire(message, TOPICS[topic])
                bag.write(topic, START_NS + number, data)
    return path


def as_on_the_wire(message: Any, kind: str) -> bytes:
    """Serialize; rmw_serialize may leave bytes at the end, which no message on the wire has."""
    data: bytes = serialize_message(message)
    for length in range(len(data), 4, -2):
        with suppress(SerdeError):
            STORE.deserialize_cdr(data[:length], kind)
            return data[:length]
    raise AssertionError(f'{kind} cannot be read back')


def test_answers_are_judged_by_the_truth(moved: tuple[Dataset, Dataset], tmp_path: Path) -> None:
    exact, measured = moved
    content = served_messages(exact, measured)
    path = write(tmp_path / 'bag', content)
    served = read_served(path, exact.joint_names)
    np.testing.assert_array_equal(served.q, exact.q[:N])
    np.testing.assert_array_equal(served.measured, measured.tau[:N])
    evaluation = score(outcome_of(served, panda(), Silent()))
    assert max(evaluation.nmse_percent) < 1e-9
    assert evaluation.kinetic_nmse_percent == pytest.approx(0.0, abs=1e-9)
    assert evaluation.potential_nmse_percent == pytest.approx(0.0, abs=1e-9)
    require_efforts(path)

    for message in content[TORQUE]:
        message.effort = [2.0 * effort for effort in message.effort]
    served = read_served(write(tmp_path / 'wrong', content), exact.joint_names)
    assert min(score(outcome_of(served, panda(), Silent())).nmse_percent) > 50


@pytest.mark.parametrize('topic', [REFERENCE, TORQUE, POTENTIAL])
def test_a_lost_message_is_told(
    moved: tuple[Dataset, Dataset], tmp_path: Path, topic: str
) -> None:
    content = served_messages(*moved)
    del content[topic][N // 2]
    with pytest.raises(DataError, match=r'messages were lost, run it on an idle machine\.$'):
        read_served(write(tmp_path / 'bag', content), moved[0].joint_names)


def test_references_that_were_overtaken_are_left_out(
    moved: tuple[Dataset, Dataset], tmp_path: Path
) -> None:
    exact, measured = moved
    content = served_messages(exact, measured)
    for topic in (TORQUE, KINETIC, POTENTIAL):
        del content[topic][N // 2]
    served = read_served(write(tmp_path / 'bag', content), exact.joint_names)
    assert (len(served.stamps), served.n_references) == (N - 1, N)
    np.testing.assert_array_equal(served.q, np.delete(exact.q[:N], N // 2, axis=0))
    for topic in (TORQUE, KINETIC, POTENTIAL):
        del content[topic][: N // 2]
    with pytest.raises(DataError, match=f'of {N} references {N // 2 - 1} have a torque'):
        read_served(write(tmp_path / 'few', content), exact.joint_names)


def test_a_plan_without_efforts_is_told(moved: tuple[Dataset, Dataset], tmp_path: Path) -> None:
    content = served_messages(*moved)
    content[PLAN_WITH_EFFORT] = [make_plan(1)]
    with pytest.raises(DataError, match=r'must come back with 7 efforts at each'):
        require_efforts(write(tmp_path / 'bag', content))


def test_the_measured_motion_is_the_exact_one_and_noise() -> None:
    settings = RobotSettings(seed=4, rate_hz=20.0, torque_noise=0.1)
    exact, measured = motion(settings)
    assert exact.tau_noiseless is not None
    assert (measured.tau - exact.tau_noiseless).std() == pytest.approx(0.1, rel=0.1)
    assert (measured.q - exact.q).std() == pytest.approx(settings.position_noise, rel=0.1)
    other, _ = motion(RobotSettings(seed=5, rate_hz=20.0))
    assert np.abs(other.q - exact.q).max() > 0.5
