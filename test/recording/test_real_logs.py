"""Real recordings: bags as they are, logs replayed into bags."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recording.bag_files import State, write_folder, write_mcap

from lip_id_ros.arrays import Array
from lip_id_ros.preprocessing import describe
from lip_id_ros.recording import JointSamples, read_bag, Reason
from lip_id_ros.settings import RecordingSettings


def states(
    stamps_ns: Iterable[int],
    names: tuple[str, ...],
    position: Array,
    velocity: Array,
    effort: Array,
) -> list[State]:
    rows = zip(stamps_ns, position, velocity, effort, strict=True)
    return [State(int(stamp), q, dq, tau, names) for stamp, q, dq, tau in rows]


def table(path: Path) -> tuple[list[str], Array]:
    with open(path, encoding='utf-8') as file:
        header = [name.strip().lstrip('- ') for name in file.readline().split(',')]
    return header, np.genfromtxt(path, delimiter=',', skip_header=1)


def assert_holds(samples: JointSamples, position: Array, velocity: Array, effort: Array) -> None:
    np.testing.assert_array_equal(samples.position, position)
    np.testing.assert_array_equal(samples.velocity, velocity)
    np.testing.assert_array_equal(samples.effort, effort)


def test_tiago_controller_states(shared_data: Path) -> None:
    """Receive stamps come in bursts up to 231 ms apart; the headers are the times."""
    samples = read_bag(shared_data / 'tiago_ros1_jtc_state' / 'arm_jointstate.bag')
    assert (samples.n_samples, samples.n_joints, samples.counts) == (2206, 7, {})
    assert (samples.clock, samples.notes) == ('header', ())
    assert samples.has_velocity
    assert not samples.has_effort
    assert 0.009 < np.diff(samples.t).min() < np.diff(samples.t).max() < 0.031


def test_kuka_without_velocity_or_time(shared_data: Path, tmp_path: Path) -> None:
    """No time was recorded: headers stay at zero and reception counts."""
    _, values = table(shared_data / 'kuka_lbr_med7' / 'measurements.csv')
    names = tuple(f'lbr_A{number}' for number in range(7))
    sent = [
        replace(state, stamp_ns=0, receive_ns=k * 10_000_000)
        for k, state in enumerate(
            states(range(len(values)), names, values[:, :7], values[:, :0], values[:, 7:14])
        )
    ]
    samples = read_bag(write_mcap(tmp_path / 'kuka.mcap', sent))
    assert (samples.n_samples, samples.counts, samples.clock) == (1647, {}, 'receive')
    assert not samples.has_velocity
    np.testing.assert_array_equal(samples.position, values[:, :7])
    np.testing.assert_array_equal(samples.effort, values[:, 7:14])


@pytest.mark.parametrize('number', [1, 4])
def test_unitree_legs_from_two_publishers(shared_data: Path, tmp_path: Path, number: int) -> None:
    """Steps from 12 us to 608 ms; front and rear legs come on topics of their own."""
    path = shared_data / 'unitree_go2_csv' / f'test_{number}_state_history.csv'
    stamps = np.genfromtxt(path, delimiter=',', usecols=[0], dtype=np.int64)
    values = np.genfromtxt(path, delimiter=',')[:, 1:]
    names = tuple(f'leg_{leg}_{joint}' for leg in range(4) for joint in range(3))
    halves = [
        replace(state, topic=topic)
        for topic, part in (('/front', slice(0, 6)), ('/rear', slice(6, 12)))
        for state in states(
            stamps,
            names[part],
            *(values[:, start : start + 12][:, part] for start in (0, 12, 24)),
        )
    ]
    halves.sort(key=lambda state: state.stamp_ns)
    bag = write_folder(tmp_path / 'bag', halves, '.mcap')
    settings = RecordingSettings(topic='/front,/rear', joints=names)
    samples = read_bag(bag, settings)
    unique, first = np.unique(stamps, return_index=True)
    assert samples.counts.get(Reason.REPEATED_STAMP, 0) == 2 * (len(stamps) - len(unique))
    assert_holds(samples, *(values[first, start : start + 12] for start in (0, 12, 24)))
    (front, _) = describe(bag)['recordings']
    steps = np.diff(unique)
    assert front['timing']['gaps'] == (steps > 5 * np.median(steps)).sum()
    assert (front['timing']['gaps'] > 0) == (number == 4)
