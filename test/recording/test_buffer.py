"""The buffer: what it takes, what it drops and why, and that it maps by name."""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Sequence
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.recording import Reason, SampleBuffer

SECOND = 1_000_000_000

NAMES = ('base', 'elbow', 'wrist')


def filled(buffer: SampleBuffer, stamps: Sequence[float]) -> SampleBuffer:
    for stamp in stamps:
        assert buffer.add(round(1e9 * stamp), NAMES, [1, 2, 3], [4, 5, 6], [7, 8, 9]) is None
    return buffer


@pytest.mark.parametrize('convert', [list, tuple, np.array, lambda values: array('d', values)])
def test_values_are_kept_in_the_order_of_the_joints(convert: Any) -> None:
    buffer = SampleBuffer(('wrist', 'base'))
    assert (
        buffer.add(5 * SECOND, NAMES, *map(convert, ([1.0, 2, 3], [4.0, 5, 6], [7.0, 8, 9])))
        is None
    )
    samples = buffer.samples('robot', '/states')
    np.testing.assert_array_equal(samples.position, [[3.0, 1.0]])
    np.testing.assert_array_equal(samples.velocity, [[6.0, 4.0]])
    np.testing.assert_array_equal(samples.effort, [[9.0, 7.0]])
    assert (samples.source, samples.topic) == ('robot', '/states')
    assert (samples.start_s, samples.t.tolist(), samples.counts) == (5.0, [0.0], {})


@given(st.lists(st.permutations(NAMES), min_size=1, max_size=30))
def test_any_order_of_names_gives_the_same_samples(orders: list[list[str]]) -> None:
    value = {'base': 1.0, 'elbow': 2.0, 'wrist': 3.0}
    buffer = SampleBuffer(NAMES)
    for stamp, names in enumerate(orders):
        values = [value[name] for name in names]
        assert buffer.add(stamp, names, values, values, values) is None
    expected = np.tile([1.0, 2.0, 3.0], (len(orders), 1))
    np.testing.assert_array_equal(buffer.samples().position, expected)
    np.testing.assert_array_equal(buffer.samples().effort, expected)


def test_a_message_that_is_dropped_does_not_choose_the_joints() -> None:
    buffer = SampleBuffer()
    assert buffer.add(1 * SECOND, ['finger'], [math.nan], [], []) is Reason.NOT_FINITE
    assert buffer.add(1 * SECOND, ['finger'], [], [], []) is Reason.NO_POSITION
    assert buffer.add(1 * SECOND, ['finger'] * 2, [0, 0], [], []) is Reason.REPEATED_NAME
    assert buffer.joint_names == ()
    assert buffer.last_stamp_ns == -1
    assert filled(buffer, [2.0]).joint_names == NAMES
    assert buffer.last_stamp_ns == 2 * SECOND


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        ((2 * SECOND, [], [], [], []), Reason.NO_NAMES),
        ((2 * SECOND, ['base', 'base', 'elbow', 'wrist'], [1] * 4, [], []), Reason.REPEATED_NAME),
        ((2 * SECOND, ['finger'], [1], [1], [1]), Reason.FOREIGN_JOINTS),
        ((2 * SECOND, ['base', 'elbow'], [1, 2], [1, 2], [1, 2]), Reason.MISSING_JOINT),
        ((2 * SECOND, NAMES, [], [1, 2, 3], [1, 2, 3]), Reason.NO_POSITION),
        ((2 * SECOND, NAMES, [1, 2], [1, 2, 3], [1, 2, 3]), Reason.POSITION_LENGTH),
        ((2 * SECOND, NAMES, [1, 2, 3, 4], [1, 2, 3], [1, 2, 3]), Reason.POSITION_LENGTH),
        ((2 * SECOND, NAMES, [1, 2, 3], [1], [1, 2, 3]), Reason.VELOCITY_LENGTH),
        ((2 * SECOND, NAMES, [1, 2, 3], [1, 2, 3], [1, 2]), Reason.EFFORT_LENGTH),
        ((2 * SECOND, NAMES, [1, math.nan, 3], [1, 2, 3], [1, 2, 3]), Reason.NOT_FINITE),
        ((2 * SECOND, NAMES, [1, 2, 3], [1, 2, math.inf], [1, 2, 3]), Reason.NOT_FINITE),
        ((2 * SECOND, NAMES, [1, 2, 3], [], [-math.inf, 2, 3]), Reason.NOT_FINITE),
        ((-1 * SECOND, NAMES, [1, 2, 3], [], []), Reason.BAD_STAMP),
        ((2**63, NAMES, [1, 2, 3], [], []), Reason.BAD_STAMP),
        ((0, NAMES, [1, 2, 3], [], []), Reason.ZERO_STAMP),
        ((1 * SECOND, NAMES, [1, 2, 3], [], []), Reason.REPEATED_STAMP),
        ((SECOND // 2, NAMES, [1, 2, 3], [], []), Reason.BACKWARD_STAMP),
    ],
)
def test_bad_message_is_dropped_and_counted(message: Any, reason: Reason) -> None:
    buffer = filled(SampleBuffer(NAMES), [1.0])
    assert buffer.add(*message) is reason
    assert buffer.add(*message) is reason
    filled(buffer, [3.0])
    assert buffer.counts == {reason: 2}
    samples = buffer.samples()
    assert samples.counts == {str(reason): 2}
    np.testing.assert_array_equal(samples.t, [0.0, 2.0])
    np.testing.assert_array_equal(samples.position, [[1, 2, 3], [1, 2, 3]])


def test_a_signal_of_nothing_but_nan_was_not_recorded() -> None:
    nothing = [math.nan] * 3
    buffer = SampleBuffer(NAMES)
    assert buffer.add(1 * SECOND, NAMES, [1, 2, 3], nothing, [4, 5, 6]) is None
    assert buffer.add(2 * SECOND, NAMES, [1, 2, 3], [], [4, 5, 6]) is None
    samples = buffer.samples()
    assert (samples.has_velocity, samples.has_effort) == (False, True)
    np.testing.assert_array_equal(samples.effort, [[4, 5, 6], [4, 5, 6]])
    assert buffer.add(3 * SECOND, NAMES, nothing, nothing, nothing) is Reason.NOT_FINITE


@pytest.mark.parametrize('first', [0.0, 1e-9])
def test_first_stamp_may_be_zero_or_next_to_it(first: float) -> None:
    assert len(filled(SampleBuffer(), [first, 1.0])) == 2


def test_velocity_and_effort_may_be_absent_throughout() -> None:
    buffer = SampleBuffer()
    buffer.add(0, NAMES, [1, 2, 3], [], [])
    samples = buffer.samples()
    assert not samples.has_velocity
    assert not samples.has_effort
    assert np.isnan(samples.velocity).all()
    assert np.isnan(samples.effort).all()
    assert samples.counts == {}


def test_messages_without_what_others_have_are_left_out() -> None:
    buffer = filled(SampleBuffer(), [0.0])
    buffer.add(1 * SECOND, NAMES, [1, 2, 3], [], [7, 8, 9])
    buffer.add(2 * SECOND, NAMES, [1, 2, 3], [4, 5, 6], [])
    buffer.add(3 * SECOND, NAMES, [1, 2, 3], [], [])
    filled(buffer, [4.0])
    samples = buffer.samples()
    np.testing.assert_array_equal(samples.t, [0.0, 4.0])
    assert samples.counts == {Reason.NO_VELOCITY: 2, Reason.NO_EFFORT: 1}


def test_samples_begin_with_the_first_that_is_complete() -> None:
    buffer = SampleBuffer()
    buffer.add(100 * SECOND, NAMES, [1, 2, 3], [4, 5, 6], [])
    samples = filled(buffer, [103.0, 104.0]).samples()
    assert samples.start_s == 103.0
    np.testing.assert_array_equal(samples.t, [0.0, 1.0])
    assert buffer.all_samples().start_s == 100.0


def test_bounded_buffer_counts_what_no_longer_fits() -> None:
    buffer = SampleBuffer(max_rows=3)
    for stamp in range(10):
        buffer.add(stamp * SECOND, NAMES, [1, 2, 3], [4, 5, 6], [7, 8, 9])
    assert len(buffer) == 3
    assert buffer.counts == {Reason.BUFFER_FULL: 7}


def test_buffer_grows() -> None:
    samples = filled(SampleBuffer(expected_rows=1), range(1000)).samples()
    np.testing.assert_array_equal(samples.t, np.arange(1000.0))
    np.testing.assert_array_equal(samples.effort, np.tile([7.0, 8, 9], (1000, 1)))


def test_samples_are_copies() -> None:
    buffer = filled(SampleBuffer(), [0.0])
    samples = buffer.samples()
    buffer.clear()
    buffer.add(0, NAMES, [0, 0, 0], [0, 0, 0], [0, 0, 0])
    np.testing.assert_array_equal(samples.position, [[1, 2, 3]])


def test_clear_forgets_joints_that_were_not_named() -> None:
    buffer = filled(SampleBuffer(), [1.0])
    buffer.add(1 * SECOND, NAMES, [1, 2, 3], [], [])
    buffer.clear()
    assert (len(buffer), buffer.counts, buffer.joint_names) == (0, Counter(), ())
    assert buffer.add(0, ['finger'], [1], [], []) is None
    assert buffer.samples().n_joints == 1


def test_endless_variety_of_names_is_not_remembered() -> None:
    buffer = filled(SampleBuffer(), [0.0])
    for number in range(1000):
        buffer.add(1 * SECOND, [f'joint_{number}'], [1], [], [])
    assert buffer.counts == {Reason.FOREIGN_JOINTS: 1000}
    assert len(buffer.samples().seen_joints) <= 64 + len(NAMES)
    buffer = filled(SampleBuffer(), [0.0])
    for number in range(3):
        buffer.add(number, [f'{number}_{joint}' for joint in range(1001)], [], [], [])
    assert buffer.counts == {Reason.TOO_MANY_NAMES: 3}
    assert buffer.samples().seen_joints == tuple(NAMES)


floats = st.floats() | st.just(math.nan)
messages = st.tuples(
    st.integers(-1, 2**64),
    st.lists(st.sampled_from([*NAMES, 'finger', '']), max_size=5),
    st.lists(floats, max_size=5),
    st.lists(floats, max_size=5),
    st.lists(floats, max_size=5),
)


@given(st.lists(messages, max_size=20))
def test_no_message_breaks_the_buffer(stream: list[Any]) -> None:
    buffer = SampleBuffer(NAMES)
    dropped = Counter(filter(None, (buffer.add(*message) for message in stream)))
    assert dropped == buffer.counts
    assert len(buffer) + sum(dropped.values()) == len(stream)
    samples = buffer.samples()
    assert samples.n_samples + sum(samples.counts.values()) == len(stream)
    assert np.isfinite(samples.position).all()
    assert (np.diff(samples.t) > 0).all()
