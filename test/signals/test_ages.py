"""Ages of messages, by clocks that are apart, are set, and deliver late."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from lip_id_ros.signals.joint_states import AgeWatch, SAME_CLOCK_S, stamp_age, WINDOW

S = 1_000_000_000
EPOCH = 1_000_000 * S


@given(st.integers(-EPOCH // 2, EPOCH // 2), st.lists(st.integers(0, 3 * S), min_size=1))
def test_the_age_is_the_wait_whatever_the_clock_of_the_sender(
    apart: int, waits: list[int]
) -> None:
    watch, now = AgeWatch(), EPOCH
    watch.age(now + apart, now, now)
    for wait in waits:
        now += S
        received = now + wait // 2
        assert watch.age(now + apart, received, now + wait) == pytest.approx(wait / S)


def test_a_burst_after_a_pause_is_as_old_as_it_is() -> None:
    """It is received when the process runs again: only the time of sending shows its age."""
    watch = AgeWatch()
    for number in range(WINDOW + 100):
        watch.age(EPOCH + number * S, 0, EPOCH + number * S)
    sent, now = EPOCH + (WINDOW + 100) * S, EPOCH + (WINDOW + 102) * S
    assert [watch.age(sent, now, now) for _ in range(WINDOW)] == [2.0] * WINDOW


def test_a_clock_that_was_set_is_followed() -> None:
    watch = AgeWatch()
    watch.age(EPOCH, EPOCH, EPOCH)
    ages = [watch.age(EPOCH + n - 3600 * S, EPOCH + n, EPOCH + n) for n in range(2 * WINDOW)]
    assert ages[0] == 3600.0
    assert ages[-1] == 0.0


def test_without_a_time_of_sending_there_is_no_age() -> None:
    assert AgeWatch().age(0, EPOCH, EPOCH + S) == 0.0


def test_a_stamp_of_another_clock_has_no_age() -> None:
    assert stamp_age(EPOCH - 2 * S, EPOCH) == 2.0
    assert stamp_age(EPOCH + 2 * S, EPOCH) == 0.0
    assert stamp_age(EPOCH - round(SAME_CLOCK_S * S) - S, EPOCH) == 0.0
