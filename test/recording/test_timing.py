"""Stamps: which clock, which order, what is wrong with them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.arrays import IntArray
from lip_id_ros.recording import Reason
from lip_id_ros.recording.timing import APART_NS, arrange, stamps_advance

STEP = 10_000_000
EPOCH = 1_700_000_000 * 10**9
CLEAN = EPOCH + STEP * np.arange(300)


def with_one(stamp: int, place: int) -> IntArray:
    return np.insert(CLEAN, place, stamp)


def test_stamps_in_order_are_left_alone() -> None:
    timeline = arrange(CLEAN)
    np.testing.assert_array_equal(timeline.rows, np.arange(300))
    np.testing.assert_array_equal(timeline.stamps_ns, CLEAN)
    assert (timeline.start_ns, timeline.dropped, timeline.late) == (EPOCH, {}, 0)


@pytest.mark.parametrize('place', [0, 1, 3, 150, 297, 299, 300])
@pytest.mark.parametrize(
    ('stamp', 'reason'),
    [
        (EPOCH + 10**18, Reason.STRAY_STAMP),
        (EPOCH + 5 * 3600 * 10**9, Reason.STRAY_STAMP),
        (EPOCH - 5 * 3600 * 10**9, Reason.STRAY_STAMP),
        (1, Reason.STRAY_STAMP),
        (0, Reason.ZERO_STAMP),
        (-1, Reason.BAD_STAMP),
    ],
)
def test_one_wrong_stamp_costs_one_message(place: int, stamp: int, reason: Reason) -> None:
    timeline = arrange(with_one(stamp, place))
    np.testing.assert_array_equal(timeline.rows, np.delete(np.arange(301), place))
    np.testing.assert_array_equal(timeline.stamps_ns, CLEAN)
    assert timeline.dropped == {reason: 1}


@pytest.mark.parametrize('away_s', [-300, -60, 60, 300])
def test_a_stamp_a_minute_away_is_far_from_its_neighbours(away_s: int) -> None:
    stamp = EPOCH + away_s * 10**9
    assert arrange(with_one(stamp, 150)).dropped == {Reason.STRAY_STAMP: 1}


@pytest.mark.parametrize('first', [0, 1])
def test_first_stamp_may_be_zero_or_next_to_it(first: int) -> None:
    timeline = arrange(np.concatenate([[first], STEP * np.arange(1, 50)]))
    assert (timeline.rows.size, timeline.start_ns, timeline.dropped) == (50, first, {})


def test_pause_is_no_reason_to_drop() -> None:
    stamps = np.concatenate([CLEAN, [CLEAN[-1] + 100 * 10**9], CLEAN + 200 * 10**9])
    timeline = arrange(stamps)
    assert (timeline.rows.size, timeline.dropped) == (601, {})


def test_clock_that_goes_back_for_good_begins_another_part() -> None:
    timeline = arrange(np.concatenate([CLEAN, CLEAN, CLEAN - 3600 * 10**9]))
    assert (timeline.rows.size, timeline.dropped, timeline.restarts) == (900, {}, 2)
    np.testing.assert_array_equal(timeline.rows, np.arange(900))
    steps = np.diff(timeline.stamps_ns)
    assert (steps[[299, 599]] == APART_NS).all()
    assert (np.delete(steps, [299, 599]) == STEP).all()


@given(st.lists(st.integers(-5, 5), min_size=100, max_size=100), st.data())
def test_any_shuffle_among_neighbours_is_undone(shifts: list[int], draws: st.DataObject) -> None:
    order = np.argsort(np.arange(100) + 1.01 * np.array(shifts), kind='stable')
    lost = draws.draw(st.lists(st.integers(0, 99), max_size=30))
    order = order[~np.isin(order, lost)]
    timeline = arrange(CLEAN[order])
    np.testing.assert_array_equal(order[timeline.rows], np.sort(order))
    assert (timeline.dropped, timeline.restarts) == ({}, 0)


@given(st.lists(st.integers(-(2**40), 2**62), max_size=200))
def test_whatever_the_stamps_all_messages_are_kept_or_counted(stamps: list[int]) -> None:
    given_ns = np.array(stamps, np.int64)
    timeline = arrange(given_ns)
    assert timeline.rows.size + sum(timeline.dropped.values()) == len(stamps)
    assert np.unique(timeline.rows).size == timeline.rows.size
    assert (np.diff(timeline.stamps_ns) > 0).all()


def test_headers_are_usable_where_they_advance() -> None:
    assert stamps_advance(CLEAN)
    assert stamps_advance(np.repeat(CLEAN, 3))
    assert not stamps_advance(np.repeat(CLEAN, 5))
    assert not stamps_advance(CLEAN[::-1])
    assert not stamps_advance(np.zeros(10, np.int64))


@pytest.mark.parametrize('back_ms', [140, 300, 305, 1000, 1300, 1450])
@pytest.mark.parametrize('lost', [0, 40])
def test_a_clock_that_is_set_back_begins_another_part(back_ms: int, lost: int) -> None:
    """What follows would be taken for late messages between those from before."""
    later = CLEAN[-1] + STEP * np.arange(1, 301) - back_ms * 1_000_000
    rng = np.random.default_rng(0)
    kept = [np.sort(rng.permutation(each)[lost:]) for each in (CLEAN, later)]
    timeline = arrange(np.concatenate(kept))
    assert (timeline.restarts, timeline.late, timeline.dropped) == (1, 0, {})
    np.testing.assert_array_equal(timeline.rows, np.arange(600 - 2 * lost))


@pytest.mark.parametrize('count', [6, 30, 100])
def test_messages_that_come_late_together_are_no_clock_that_was_set_back(count: int) -> None:
    """A buffer that is sent after newer messages leaves a hole before it."""
    order = np.concatenate([np.arange(100), np.arange(100 + count, 220), np.arange(100, 300)])
    order = order[np.sort(np.unique(order, return_index=True)[1])]
    timeline = arrange(CLEAN[order])
    assert (timeline.restarts, timeline.late) == (0, count)
    np.testing.assert_array_equal(timeline.stamps_ns, CLEAN)


@pytest.mark.parametrize('count', [15, 60, 100])
def test_messages_that_come_twice_together_are_dropped(count: int) -> None:
    jitter = np.random.default_rng(0).integers(-STEP // 10, STEP // 10, CLEAN.size)
    stamps = CLEAN + jitter
    timeline = arrange(np.concatenate([stamps[:200], stamps[200 - count :]]))
    assert (timeline.restarts, timeline.dropped.total()) == (0, count)
    np.testing.assert_array_equal(timeline.stamps_ns, stamps)
