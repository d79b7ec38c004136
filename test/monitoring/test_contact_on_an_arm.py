"""A learned model detects contacts of a simulated arm, and none in free motion."""

from __future__ import annotations

import pytest

from benchmarks._zoo import load_arm
from benchmarks.contact import figures
from lip_id_ros.simulation.arm import panda_urdf

pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')


@pytest.mark.slow
def test_contacts_are_flagged_within_100_ms_and_free_motion_never() -> None:
    (found,) = figures(load_arm(panda_urdf(), 'panda_joint1', 'panda_joint2'), [5.0], 0)
    assert found['false_flags'] == 0
    assert found['found'] == '8 of 8'
    assert found['longest_delay_ms'] <= 100  # type: ignore[operator]
