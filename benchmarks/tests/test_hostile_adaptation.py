"""What follows an arm is never much worse than the fit, whatever an hour teaches."""

from __future__ import annotations

import pytest

from benchmarks.hostile_adaptation import HOURS, measured


@pytest.mark.slow
@pytest.mark.parametrize('hour', HOURS)
def test_nothing_true_is_lost(hour: str) -> None:
    found = measured(hour, 0, 120.0)
    assert found['before'] < 0.1
    assert found['during'] < 1.1
    assert found['after'] < 1.1
    assert found['at_last'] < 0.1
    assert found['beyond'] == 0
