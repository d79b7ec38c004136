"""Rates and ages of inputs."""

from __future__ import annotations

from lip_id_ros.signals.streams import DEAD_S, Stream


def test_a_stream_that_ends_is_dead_and_what_comes_when_it_comes_is_not() -> None:
    lasting, plans = Stream(lasting=True), Stream(lasting=False)
    assert lasting.record(0.0) == {'rate_hz': 0.0, 'age_s': None}
    assert not lasting.is_dead(99.0)  # it has not come yet
    for number in range(1, 101):
        for each in (lasting, plans):
            each.arrived(0.01 * number)
    assert lasting.record(2.0) == {'rate_hz': 50.0, 'age_s': 1.0}
    assert not lasting.is_dead(1.0 + DEAD_S)
    assert lasting.is_dead(1.01 + DEAD_S)
    assert not plans.is_dead(99.0)
    for number in range(10):
        found = lasting.record(3.0 + 0.5 * number)
    assert found['rate_hz'] == 0.0
