"""Several layouts or publishers of the same joints on one topic never give a wrong time axis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recording.bag_files import State, write_folder, write_ros1

from lip_id_ros.arrays import Array
from lip_id_ros.recording import JointSamples, read_bag, Reason
from lip_id_ros.settings import RecordingSettings

NAMES = ('shoulder', 'elbow')
JOINTS = RecordingSettings(joints=NAMES)
EPOCH = 1_700_000_000 * 10**9
SECONDS = 60.0
PARTS = ('names', 'position', 'velocity', 'effort')


def driver(
    rate: int, seconds: float = SECONDS, delay_s: float = 0.0, **changes: Any
) -> list[State]:
    """Return what a driver publishes of a motion that only time decides."""
    t = np.arange(int(rate * seconds)) / rate + delay_s
    return [
        replace(
            State(
                stamp_ns=EPOCH + round(1e9 * time),
                position=position(time),
                velocity=(np.cos(time), -np.sin(time)),
                effort=(3.0 * np.sin(time), 2.0),
            ),
            **changes,
        )
        for time in t.tolist()
    ]


def position(t: Any) -> Any:
    return np.sin(t), np.cos(t)


def in_turns(first: Sequence[State], second: Sequence[State]) -> list[State]:
    return sorted([*first, *second], key=received)


def received(state: State) -> int:
    return state.stamp_ns if state.receive_ns is None else state.receive_ns


def turned(state: State) -> State:
    values: dict[str, Any] = {name: tuple(getattr(state, name))[::-1] for name in PARTS}
    return replace(state, **values)


def every_other(states: Sequence[State], change: Callable[[State], State]) -> list[State]:
    return [change(state) if number % 2 else state for number, state in enumerate(states)]


def with_gripper(state: State) -> State:
    wider: dict[str, Any] = {
        'names': (*state.names, 'finger'),
        'position': (*state.position, 0.0),
        'velocity': (*state.velocity, 0.0),
        'effort': (*state.effort, 0.0),
    }
    return replace(state, **wider)


def assert_right_times(samples: JointSamples, rate: float, tolerance: float = 1e-9) -> None:
    assert samples.t[-1] == pytest.approx(SECONDS, abs=0.1)
    assert np.median(np.diff(samples.t)) == pytest.approx(1.0 / rate, rel=1e-3)
    expected: Array = np.column_stack(position(samples.t + samples.start_s - EPOCH / 1e9))
    np.testing.assert_allclose(samples.position, expected, atol=tolerance)


@pytest.mark.parametrize(
    'change', [lambda state: replace(state, frame_id='base'), turned], ids=['frame', 'order']
)
def test_two_layouts_of_one_publisher_keep_the_order_of_the_file(
    tmp_path: Path, change: Callable[[State], State]
) -> None:
    path = write_folder(tmp_path / 'bag', every_other(driver(100), change))
    samples = read_bag(path, JOINTS)
    assert samples.n_samples == SECONDS * 100
    assert (samples.counts, samples.notes, samples.clock) == ({}, (), 'header')
    assert_right_times(samples, 100, 1e-6)


def test_two_definitions_on_one_topic_keep_the_order_of_the_file(tmp_path: Path) -> None:
    path = write_ros1(tmp_path / 'a.bag', driver(100), publishers=2)
    assert_right_times(read_bag(path, JOINTS), 100, 1e-6)


def test_a_driver_is_preferred_to_what_repeats_it(tmp_path: Path) -> None:
    """The aggregator publishes at half the rate, stamps anew and is late."""
    late = [
        with_gripper(replace(state, stamp_ns=state.stamp_ns + 7_000_000))
        for state in driver(100)[::2]
    ]
    path = write_folder(tmp_path / 'bag', in_turns(driver(100), late))
    samples = read_bag(path, JOINTS)
    assert_right_times(samples, 100, 1e-6)
    assert samples.counts == {Reason.OTHER_PUBLISHER: len(late)}
    assert samples.notes == (
        '2 publishers have the same joints: the one with 6000 messages '
        '(it has no other joints) was taken',
    )


def test_a_frame_of_its_own_for_every_message_is_no_publisher_of_its_own(tmp_path: Path) -> None:
    states = [replace(state, frame_id=f'{k:06}') for k, state in enumerate(driver(100))]
    samples = read_bag(write_folder(tmp_path / 'bag', states), JOINTS)
    assert_right_times(samples, 100, 1e-6)
    assert samples.counts == {}


def test_two_clocks_that_look_alike_give_times_of_reception(tmp_path: Path) -> None:
    ahead = [
        replace(state, receive_ns=state.stamp_ns, stamp_ns=state.stamp_ns + 3 * 10**9)
        for state in driver(100, delay_s=0.004)
    ]
    path = write_folder(tmp_path / 'bag', in_turns(driver(100), ahead))
    samples = read_bag(path, JOINTS)
    assert samples.clock == 'receive'
    assert samples.n_samples == 2 * 100 * SECONDS
    expected = np.column_stack(position(samples.t))
    np.testing.assert_allclose(samples.position, expected, atol=1e-6)
    assert 'the header stamps are those of several clocks' in samples.notes[0]


def test_a_clock_that_begins_again_every_second_is_not_trusted(tmp_path: Path) -> None:
    """A driver that fills in the nanoseconds only."""
    states = [
        replace(state, receive_ns=state.stamp_ns, stamp_ns=state.stamp_ns % 10**9)
        for state in driver(100)
    ]
    samples = read_bag(write_folder(tmp_path / 'bag', states), JOINTS)
    assert samples.clock == 'receive'
    np.testing.assert_allclose(samples.t, np.arange(6000) / 100, atol=1e-6)
