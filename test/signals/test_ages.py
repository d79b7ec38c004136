"""Ages of references by clocks that are apart, or are set."""

from __future__ import annotations

import numpy as np
import pytest

from lip_id_ros.signals.ages import AgeWatch, CLOCK_CONFIRMED_S, ReferenceStamps
from lip_id_ros.signals.joints import RefusedError

S = 1_000_000_000
EPOCH = 1_000_000 * S


def ages(
    watch: AgeWatch, apart_s: float, rate_hz: float = 100.0, begin_s: float = 0.0
) -> list[float]:
    """Return ages of a second of messages whose sender's clock is `apart_s` behind."""
    at = [EPOCH + round(S * (begin_s + k / rate_hz)) for k in range(round(rate_hz))]
    return [watch.age(now - round(S * apart_s), now, now) for now in at]


def test_messages_wait_in_the_queue_of_the_node() -> None:
    assert AgeWatch().age(EPOCH, EPOCH, EPOCH + S) == 1.0
    assert AgeWatch().age(0, EPOCH, EPOCH + S) == 1.0


def test_the_first_message_may_be_old() -> None:
    assert AgeWatch().age(EPOCH, EPOCH + 8 * S, EPOCH + 8 * S) == 8.0


@pytest.mark.parametrize('rate_hz', [20.0, 100.0, 1000.0])
@pytest.mark.parametrize('step_s', [1.0, 3600.0])
def test_a_clock_that_was_set_back_is_believed_in_half_a_second(
    rate_hz: float, step_s: float
) -> None:
    watch = AgeWatch()
    assert not any(ages(watch, 0.0, rate_hz))
    found = np.array(ages(watch, step_s, rate_hz, 1.0))
    assert found[0] == step_s
    assert not found[round(0.5 * rate_hz) :].any()


def test_a_clock_that_is_ahead_makes_nothing_old() -> None:
    watch = AgeWatch()
    assert not any(ages(watch, -2.0))
    assert not any(ages(watch, 0.0, begin_s=2.0)[50:])


def test_one_message_of_a_clock_that_is_ahead_changes_nothing() -> None:
    """One plan from a computer 2 s ahead stopped a stream of 100 Hz for 13 s."""
    watch = AgeWatch()
    ages(watch, 0.0)
    assert watch.age(EPOCH + 3 * S, EPOCH + S, EPOCH + S) == 0.0
    assert not any(ages(watch, 0.0, begin_s=1.01))


def test_a_burst_after_a_pause_is_as_old_as_it_is() -> None:
    """It is received when the process runs again: only the time of sending shows its age."""
    watch = AgeWatch()
    ages(watch, 0.0)
    now = EPOCH + 14 * S
    found = [watch.age(EPOCH + S + k * S // 100, now + k, now + k) for k in range(1300)]
    np.testing.assert_allclose(found, 13.0 - 0.01 * np.arange(1300), atol=1e-5)


def test_a_queue_that_empties_is_old_all_the_while() -> None:
    """A radio link that was down for 5 s catches up within 3 s."""
    watch = AgeWatch()
    ages(watch, 0.0)
    sent = 1.0 + np.arange(0.0, 8.0, 0.01)
    received = 6.0 + 3.0 / 8.0 * (sent - 1.0)
    found = [
        watch.age(EPOCH + round(S * one), EPOCH + round(S * two), EPOCH + round(S * two))
        for one, two in zip(sent, received, strict=True)
    ]
    np.testing.assert_allclose(found, received - sent, atol=1e-6)


def test_stamps_that_go_back_are_refused_until_no_others_come() -> None:
    order = ReferenceStamps()

    def take(stamp_ns: int, now: float) -> None:
        order.require(stamp_ns, now)
        order.take(stamp_ns, now)

    for k in range(100):  # every second one is 0.4 s behind
        now = 0.01 * k
        if k % 2:
            with pytest.raises(RefusedError, match='lies before that of the last message'):
                take(EPOCH + round(S * (now - 0.4)), now)
        else:
            take(EPOCH + round(S * now), now)
    with pytest.raises(RefusedError):
        take(EPOCH - S, 0.99 + 0.9 * CLOCK_CONFIRMED_S)
    take(EPOCH - S, 0.99 + 1.1 * CLOCK_CONFIRMED_S)
    take(EPOCH - S, 0.99 + 1.2 * CLOCK_CONFIRMED_S)


def test_stamps_of_references_that_are_refused_say_nothing() -> None:
    """5 Hz of another arm's, 10 s ahead, had 99 of 100 good ones refused."""
    order = ReferenceStamps()
    order.require(EPOCH + 10 * S, 0.0)
    order.require(EPOCH, 0.01)
