"""What follows an arm is never much worse than the fit, whatever an hour teaches."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from benchmarks import hostile_adaptation
from benchmarks.hostile_adaptation import Arm, FIT_S, HOURS, measured, motion
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel


@cache
def fitted() -> InverseDynamicsModel:
    """Fit once for all kinds of hours: each would draw another motion of the same arm."""
    rng, arm = np.random.default_rng(0), Arm(0, 1.0)
    states = motion(rng, FIT_S)
    return fit(Dataset.from_arrays(*states, arm.measured(states, rng)))


@pytest.mark.slow
@pytest.mark.parametrize('hour', HOURS)
def test_nothing_true_is_lost(hour: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hostile_adaptation, 'fit', lambda data: fitted())
    found = measured(hour, 0, 120.0)
    assert found['before'] < 0.1
    assert found['during'] < 1.1
    assert found['after'] < 1.1
    assert found['at_last'] < 0.1
    assert found['beyond'] == 0
