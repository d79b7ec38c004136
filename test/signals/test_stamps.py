"""Stamps of one clock: wrong ones are doubted, a jump is followed when it is confirmed."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from lip_id_ros.signals.joint_states import (
    JUMP_CONFIRMED_BY,
    StampWatch,
)
from lip_id_ros.signals.joints import Refusal

S = 1_000_000_000


def doubts(stamps: list[float]) -> list[Refusal | None]:
    watch = StampWatch(1.0)
    return [watch.doubt(round(S * stamp)) for stamp in stamps]


@given(st.lists(st.floats(1e-6, 1.0), min_size=1, max_size=30))
def test_a_steady_clock_is_never_doubted(steps: list[float]) -> None:
    stamps, now = [], 100.0
    for step in steps:
        now += step
        stamps.append(now)
    assert not any(doubts(stamps))


@pytest.mark.parametrize(
    ('wrong', 'reason'),
    [
        (0.0, Refusal.NO_STAMP),
        (-5.0, Refusal.NO_STAMP),
        (10.0, Refusal.REPEATED_STAMP),
        (9.0, Refusal.BACKWARD_STAMP),
        (1e9, Refusal.FAR_STAMP),
    ],
)
def test_one_wrong_stamp_is_refused_alone(wrong: float, reason: Refusal) -> None:
    assert doubts([9.9, 10.0, wrong, 10.1, 10.2]) == [None, None, reason, None, None]


@pytest.mark.parametrize(
    ('there', 'reason'), [(5.0, Refusal.BACKWARD_STAMP), (50.0, Refusal.FAR_STAMP)]
)
def test_a_jump_is_followed_once_confirmed(there: float, reason: Refusal) -> None:
    watch = StampWatch(1.0)
    stamps = [10.0, 10.1, *(there + 0.1 * step for step in range(5)), 10.2]
    found = [watch.doubt(round(S * stamp)) for stamp in stamps]
    doubted = JUMP_CONFIRMED_BY - 1
    assert found[:2] == [None, None]
    assert found[2 : 2 + doubted] == [reason] * doubted
    assert found[2 + doubted : 7] == [None] * (5 - doubted)
    assert found[7] is not None
    assert watch.jumps == 1


def test_doubted_stamps_that_do_not_follow_one_another_confirm_nothing() -> None:
    far = [50.0, 30.0, 70.0, 20.0, 90.0]
    assert doubts([10.0, *far, 10.1]) == [None, *[Refusal.FAR_STAMP] * 5, None]


def test_two_clocks_in_turn_never_confirm_each_other() -> None:
    found = doubts(
        [each for step in range(50) for each in (10.0 + 0.01 * step, 13.0 + 0.01 * step)]
    )
    assert found[::2] == [None] * 50
    assert found[1::2] == [Refusal.FAR_STAMP] * 50


def test_a_stamp_may_be_as_far_ahead_as_its_message_was_long_in_coming() -> None:
    """One that is 0.9 s ahead without a pause is doubted, one after a pause of 3 s is not."""
    watch = StampWatch(0.1)
    arrivals = [(10.0, 5.0), (10.01, 5.01), (10.9, 5.02), (10.03, 5.03), (13.0, 8.0)]
    found = [watch.doubt(round(S * stamp), round(S * at)) for stamp, at in arrivals]
    assert found == [None, None, Refusal.FAR_STAMP, None, None]
