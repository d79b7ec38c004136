"""A learned model detects contacts of a simulated arm, and none in free motion."""

from __future__ import annotations

import pytest

from benchmarks.contact import measure
from lip_id_ros.settings import FitSettings

pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')


@pytest.mark.slow
def test_contacts_are_flagged_within_100_ms_and_free_motion_never() -> None:
    found = measure(2, 0, 5.0, 30.0, FitSettings(subset=80, max_samples=400, iterations=20))

    assert found['false_flags'] == 0
    assert all(delay is not None and delay < 0.1 for joint in found['delay_s'] for delay in joint)
    assert all(largest > 0.05 for largest in found['largest_free'])  # the arm did move
