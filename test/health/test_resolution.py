"""Steps, plateaus and clipped ends of made signals."""

from __future__ import annotations

from pathlib import Path
import re

from health.recordings import sound
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.health import CHECKS, evidence_of, health
from lip_id_ros.health.evidence import Signal
from lip_id_ros.preprocessing.segments import quantum

T = np.arange(4000) / 100.0


def wave(seed: int, noise: float = 0.0) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    rng = np.random.default_rng(seed)
    rates, phases = rng.uniform(0.5, 5.0, 4), rng.uniform(0.0, 2 * np.pi, 4)
    return np.asarray(
        np.sin(np.multiply.outer(T, rates) + phases).sum(axis=1)
        + noise * rng.standard_normal(T.size)
    )


@given(st.integers(0, 1000), st.floats(0.02, 0.5), st.floats(1e-6, 1e6))
def test_the_step_of_a_quantised_signal_is_found(seed: int, step: float, unit: float) -> None:
    values = unit * step * np.round(wave(seed) / step)
    assert quantum(values) == pytest.approx(unit * step, rel=1e-6)


@given(st.integers(0, 1000))
def test_a_smooth_signal_has_no_step(seed: int) -> None:
    assert quantum(wave(seed, 0.01)) == 0.0
    assert quantum(np.zeros(50)) == 0.0


@given(st.integers(0, 1000), st.floats(1e-3, 0.3))
def test_a_quantised_signal_is_not_clipped(seed: int, step: float) -> None:
    assert Signal(step * np.round(wave(seed) / step)).clipped_share == 0.0


@given(st.integers(0, 1000), st.sampled_from([0.0, 0.05]), st.sampled_from([1.0, -1.0]))
def test_a_clipped_signal_is_clipped(seed: int, noise: float, side: float) -> None:
    values = wave(seed, noise)
    limit = np.percentile(values, 90)
    assert Signal(side * np.minimum(values, limit)).clipped_share == pytest.approx(0.1, abs=0.02)
    assert Signal(values).clipped_share == 0.0


REFERENCE = Path(__file__).resolve().parents[2] / 'docs' / 'reference'
PAGE = (REFERENCE / 'health.md').read_text(encoding='utf-8')


def test_the_table_is_that_of_the_code() -> None:
    documented = re.findall(
        r'^\| `(\w+)` \| (\w+) \| (.+?) \| (.+?) \|$', PAGE, flags=re.MULTILINE
    )
    assert documented == [
        (check.code, check.severity.value, check.meaning, check.remedy) for check in CHECKS
    ]


def test_the_figures_are_those_of_the_code() -> None:
    described = health(evidence_of(sound()))
    text = PAGE.partition('In JSON,')[2].partition('## How')[0]
    named = set(re.findall(r'`(\w+)`', text))
    assert set(described) | set(described['joints']['arm_joint1']) <= named
