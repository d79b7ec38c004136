"""States published again under new stamps, signals at rates of their own, and arms at rest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from preprocessing.motions import recording, relative_error, Sinusoids, uniform, without_velocity
import pytest

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.preprocessing import preprocess, smoothing
from lip_id_ros.preprocessing.sample_times import (
    changes_of,
    source_periods,
    stale,
)
from lip_id_ros.preprocessing.segment import segment_of
from lip_id_ros.preprocessing.segments import quantum
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.reading import read_log
from lip_id_ros.settings import PreprocessingSettings

MOTION = Sinusoids(highest_hz=1.5)
SECONDS = 24.0
MOVE_S = 2.0
GRAVITY = 3.0


def moves_and_rests(rate: float, noise: float, step: float = 1e-5) -> JointSamples:
    """Record moves of 2 s with rests of 2 s between them, positions quantised."""
    rng = np.random.default_rng(0)
    t = uniform(int(SECONDS * rate), rate)
    number, phase = np.divmod(t, 2.0 * MOVE_S)
    goals = rng.uniform(-1.0, 1.0, (int(SECONDS / 2.0 / MOVE_S) + 1, 2))
    start, way = goals[number.astype(int)], np.diff(goals, axis=0)[number.astype(int)]
    u = np.minimum(phase / MOVE_S, 1.0)[:, None]
    q = start + way * (10 * u**3 - 15 * u**4 + 6 * u**5)
    dq = way * (30 * u**2 - 60 * u**3 + 30 * u**4) / MOVE_S
    ddq = way * (60 * u - 180 * u**2 + 120 * u**3) / MOVE_S**2
    tau = law(q, dq, ddq)
    tau += noise * tau.std() * rng.standard_normal(tau.shape)
    return recording(t, position=step * np.round(q / step), velocity=dq, effort=tau)


def law(q: Array, dq: Array, ddq: Array) -> Array:
    return np.asarray(2.0 * ddq + 0.5 * dq + GRAVITY * np.sin(q))


def law_error(data: Dataset) -> float:
    return relative_error(law(data.q, data.dq, data.ddq), data.tau)


def stale_samples(samples: JointSamples) -> BoolArray:
    return stale(samples, changes_of(samples))


def published_again(samples: JointSamples, rate: float, publish_hz: float) -> JointSamples:
    t = uniform(int(samples.n_samples / rate * publish_hz), publish_hz)
    newest = newest_rows(t, rate)
    signals = {name: getattr(samples, name)[newest] for name in ('position', 'velocity', 'effort')}
    return replace(samples, t=t, **signals)


def newest_rows(t: Array, rate: float) -> IndexArray:
    rows: IndexArray = np.floor(t * rate + 1e-9).astype(np.intp)
    return rows


@pytest.mark.parametrize('has_velocity', [True, False])
@pytest.mark.parametrize('noise', [0.0, 0.02])
@pytest.mark.parametrize('publish_hz', [200.0, 500.0, 830.0])
def test_repeated_states_count_once(publish_hz: float, noise: float, has_velocity: bool) -> None:
    """Whether the arm moves or rests: the same samples as of the recording at its own rate."""
    original = moves_and_rests(100.0, noise)
    again = published_again(original, 100.0, publish_hz)
    if not has_velocity:
        original, again = without_velocity(original), without_velocity(again)
    once, data = preprocess(original), preprocess(again)
    assert np.unique(data.segment).size == 1
    assert data.n_samples == pytest.approx(once.n_samples, rel=0.12)
    assert law_error(data) < 1.1 * law_error(once) + 2e-3
    (source,) = data.provenance['sources']
    assert source['dropped']['sample stale'] > 0.9 * (again.n_samples - original.n_samples)


@pytest.mark.parametrize('has_velocity', [True, False])
@pytest.mark.parametrize('noise', [0.0, 0.02])
def test_nothing_of_a_true_rest_is_left_out(noise: float, has_velocity: bool) -> None:
    samples = moves_and_rests(100.0, noise)
    assert (np.diff(samples.position, axis=0) == 0.0).all(axis=1).mean() > 0.4
    assert not stale_samples(samples if has_velocity else without_velocity(samples)).any()


def test_nothing_of_a_real_rest_is_left_out(shared_data: Path) -> None:
    """An arm that stands between pick and place, its velocities zero and its efforts noisy."""
    samples = read_log(shared_data / 'kuka_lwr_polydoros/kuka_lwr_1.csv')
    assert (samples.velocity == 0.0).all(axis=1).sum() > 300
    assert not stale_samples(samples).any()


@pytest.mark.parametrize('rate', [30.0, 100.0])
@pytest.mark.parametrize('signal', ['position', 'effort'])
def test_a_signal_at_a_rate_of_its_own_is_interpolated(signal: str, rate: float) -> None:
    """Held over many samples it would be late by half of them: errors of 3 to 12 %."""
    samples = recording(uniform(10_000, 500.0), MOTION)
    if signal == 'position':
        samples = without_velocity(samples)
    rows = np.ceil(np.floor(samples.t * rate + 1e-9) / rate * 500.0 - 1e-9).astype(np.intp)
    held = replace(samples, **{signal: getattr(samples, signal)[rows]})
    data = preprocess(held)
    assert relative_error(2.0 * data.ddq + 0.5 * data.dq, data.tau) < 0.01
    period = data.provenance['sources'][0]['source_periods']
    assert period == {signal: pytest.approx(500.0 / rate, abs=1.0)}


@given(st.integers(0, 8), st.integers(60, 70))
def test_pieces_that_end_in_a_held_value_are_not_extrapolated(first: int, last: int) -> None:
    samples = recording(uniform(200, 100.0), MOTION)
    samples = replace(samples, effort=samples.effort[9 * (np.arange(200) // 9)])
    changes = changes_of(samples)
    segment = segment_of(samples, slice(None), changes, source_periods(changes), 100.0)
    assert segment.longest_hold == 9
    piece = segment.rows(slice(first, last + 1))
    effort = piece.uniform(piece.t).effort
    assert (effort <= piece.effort.max(axis=0) + 1e-12).all()
    assert (effort >= piece.effort.min(axis=0) - 1e-12).all()
    np.testing.assert_allclose(effort[[0, -1]], piece.effort[[0, -1]], rtol=1e-12)


def test_held_signals_of_long_segments_are_smoothed_in_windows_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    samples = recording(uniform(8000, 500.0), MOTION)
    samples = replace(samples, effort=samples.effort[17 * (np.arange(8000) // 17)])
    settings = PreprocessingSettings(cutoff_hz=0.0)
    whole = preprocess(samples, settings)
    monkeypatch.setattr(smoothing, '_WINDOW', 400)
    np.testing.assert_allclose(preprocess(samples, settings).tau, whole.tau, atol=1e-12)


@pytest.mark.parametrize(('share', 'found'), [(0.0, 0.25), (0.04, 0.25), (0.3, 0.0), (0.45, 0.0)])
def test_a_grid_is_that_of_nearly_all_levels(share: float, found: float) -> None:
    """Of some levels an offset is not on the grid; each is repeated."""
    rng = np.random.default_rng(0)
    levels = 0.25 * np.arange(100.0)
    off = rng.choice(100, round(50 * share), replace=False)
    levels[off] += 0.1
    assert quantum(rng.permutation(np.repeat(levels, 10))) == pytest.approx(found)
