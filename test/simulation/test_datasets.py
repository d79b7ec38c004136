"""Simulated data sets and bags hold exactly what the arm did."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores

from lip_id_ros.dataset import Dataset
from lip_id_ros.simulation import (
    make_dataset,
    panda,
    SinusoidTrajectory,
    with_encoder_noise,
    with_truth,
    write_bag,
)
from lip_id_ros.simulation.arm import MOTION, SimulatedArm

TIMES = np.arange(0, 5, 0.01)


@pytest.fixture(scope='module')
def arm() -> SimulatedArm:
    pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')
    return panda(3)


@pytest.fixture(scope='module')
def trajectory() -> SinusoidTrajectory:
    return SinusoidTrajectory.random(MOTION.first(3), np.random.default_rng(1))


@pytest.fixture(scope='module')
def dataset(arm: SimulatedArm, trajectory: SinusoidTrajectory) -> Dataset:
    noise_std = np.array([0.1, 0.2, 0.4])
    return make_dataset(arm, trajectory, TIMES, noise_std, np.random.default_rng(2))


def test_truth_stands_beside_noise_of_the_given_size(dataset: Dataset, arm: SimulatedArm) -> None:
    assert dataset.tau_noiseless is not None
    np.testing.assert_array_equal(
        dataset.tau_noiseless, arm.inverse_dynamics(dataset.q, dataset.dq, dataset.ddq)
    )
    noise = dataset.tau - dataset.tau_noiseless
    np.testing.assert_allclose(noise.std(axis=0), [0.1, 0.2, 0.4], rtol=0.15)
    np.testing.assert_array_equal(dataset.kinetic, arm.kinetic(dataset.q, dataset.dq))
    np.testing.assert_array_equal(dataset.potential, arm.potential(dataset.q))
    assert dataset.joint_names == arm.joint_names


def test_encoder_noise_leaves_torques_and_truth(dataset: Dataset) -> None:
    noisy = with_encoder_noise(dataset, 1e-3, 1e-2, np.random.default_rng(3))

    assert (noisy.q - dataset.q).std() == pytest.approx(1e-3, rel=0.1)
    assert (noisy.dq - dataset.dq).std() == pytest.approx(1e-2, rel=0.1)
    np.testing.assert_array_equal(noisy.tau, dataset.tau)
    np.testing.assert_array_equal(noisy.kinetic, dataset.kinetic)


def test_truth_is_found_again_by_time(
    dataset: Dataset, arm: SimulatedArm, trajectory: SinusoidTrajectory
) -> None:
    measured = Dataset(
        t=dataset.t[7:90] + 1234.5,
        q=dataset.q[7:90],
        dq=dataset.dq[7:90],
        ddq=dataset.ddq[7:90],
        tau=dataset.tau[7:90],
        joint_names=dataset.joint_names,
        joint_types=dataset.joint_types,
        segment=dataset.segment[7:90],
    )

    known = with_truth(measured, arm, trajectory, start=1234.5)

    assert known.tau_noiseless is not None
    assert known.kinetic is not None
    assert dataset.tau_noiseless is not None
    assert dataset.kinetic is not None
    np.testing.assert_allclose(known.tau_noiseless, dataset.tau_noiseless[7:90], atol=1e-6)
    np.testing.assert_allclose(known.kinetic, dataset.kinetic[7:90], atol=1e-6)
    np.testing.assert_array_equal(known.tau, measured.tau)


def test_bag_holds_one_message_per_sample(dataset: Dataset, tmp_path: Path) -> None:
    write_bag(tmp_path / 'run', dataset, start=1.7e9)

    with AnyReader(
        [tmp_path / 'run'], default_typestore=get_typestore(Stores.ROS2_JAZZY)
    ) as reader:
        messages: list[Any] = [
            reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()
        ]
        topics = [connection.topic for connection in reader.connections]

    assert topics == ['/joint_states']
    assert [tuple(message.name) for message in messages] == [dataset.joint_names] * len(TIMES)
    np.testing.assert_array_equal([message.position for message in messages], dataset.q)
    np.testing.assert_array_equal([message.velocity for message in messages], dataset.dq)
    np.testing.assert_array_equal([message.effort for message in messages], dataset.tau)
    stamps = [message.header.stamp for message in messages]
    seconds = [(stamp.sec - 1_700_000_000) + stamp.nanosec * 1e-9 for stamp in stamps]
    np.testing.assert_allclose(seconds, TIMES, atol=1e-6)
    assert list(tmp_path.iterdir()) == [tmp_path / 'run']


def test_a_bag_is_never_written_over(dataset: Dataset, tmp_path: Path) -> None:
    (tmp_path / 'run').mkdir()
    with pytest.raises(FileExistsError, match='run exists; choose another name'):
        write_bag(tmp_path / 'run', dataset)
    assert list((tmp_path / 'run').iterdir()) == []
