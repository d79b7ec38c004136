"""Recordings made into data sets: accuracy, gaps, stale samples, counts."""

from __future__ import annotations

import contextlib
from dataclasses import replace
import json
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from preprocessing.motions import (
    dropped,
    recording,
    relative_error,
    Sinusoids,
    uniform,
    without_velocity,
)
import pytest

from lip_id_ros.errors import DataError
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import preprocess, smoothing
from lip_id_ros.preprocessing.smoothing import low_pass
from lip_id_ros.recording import read_bag, spill
from lip_id_ros.settings import Config, PreprocessingSettings, RecordingSettings

T = uniform(1000, 100.0)


@pytest.mark.parametrize('rate', [30.0, 125.0, 500.0])
def test_motion_comes_out_as_it_was(rate: float) -> None:
    motion = Sinusoids()
    data = preprocess(recording(uniform(int(20 * rate), rate)))
    assert relative_error(data.q, motion.position(data.t)) < 1e-3
    assert relative_error(data.dq, motion.velocity(data.t)) < 1e-3
    assert relative_error(data.ddq, motion.acceleration(data.t)) < 1e-3
    assert relative_error(data.tau, motion.torque(data.t)) < 1e-3


def test_velocity_comes_from_position_where_it_is_missing() -> None:
    motion = Sinusoids()
    data = preprocess(without_velocity(recording(T)))
    assert relative_error(data.dq, motion.velocity(data.t)) < 1e-3
    assert relative_error(data.ddq, motion.acceleration(data.t)) < 2e-3
    assert data.provenance['sources'][0]['velocity'] == 'differentiated from position'


def test_same_low_pass_on_all_signals() -> None:
    """Above the cut-off, torque and acceleration lose the same: the law between them stays."""
    motion = Sinusoids(highest_hz=5.0)
    data = preprocess(recording(uniform(10_000, 500.0), motion))
    assert relative_error(data.ddq, motion.acceleration(data.t)) > 0.1
    assert relative_error(2.0 * data.ddq + 0.5 * data.dq, data.tau) < 5e-3


def test_signs_of_velocities_go_through_the_same_low_pass() -> None:
    t = uniform(4000, 200.0)
    data = preprocess(recording(t))
    full = np.sign(low_pass(Sinusoids().velocity(t), 200.0, 4.0))
    sign, expected = data.low_passed_sign, low_pass(full, 200.0, 4.0)
    rows = np.searchsorted(t, data.t - 1e-9)
    assert sign is not None
    assert np.mean(np.abs(sign - np.sign(data.dq)) > 0.05) > 0.1
    np.testing.assert_allclose(sign, expected[rows], atol=0.02)


def test_nothing_crosses_a_gap() -> None:
    before, behind = T[:400], T[500:]
    both = np.concatenate([before, behind])
    data = preprocess(recording(both))
    np.testing.assert_array_equal(np.unique(data.segment), [0, 1])
    for number, part in enumerate((before, behind)):
        alone = preprocess(recording(part))
        rows = data.segment == number
        for name in ('t', 'q', 'dq', 'ddq', 'tau', 'low_passed_sign'):
            np.testing.assert_allclose(
                getattr(data, name)[rows], getattr(alone, name), rtol=1e-9, atol=1e-9, err_msg=name
            )


@given(st.integers(1, 20), st.integers(0, 400))
def test_every_sample_is_kept_or_counted(decimate: int, max_samples: int) -> None:
    settings = PreprocessingSettings(decimate=decimate, max_samples=max_samples)
    t = np.concatenate([T[:400], T[450:500], T[600:]])
    samples = recording(t, counts={'stamp repeated': 4})
    data = preprocess(samples, settings)
    counted = dropped(data)
    assert counted.pop('stamp repeated') == 4
    selected = data.provenance.get('selected', {'samples': data.n_samples, 'of': data.n_samples})
    assert data.n_samples == selected['samples']
    assert selected['of'] + sum(counted.values()) == samples.n_samples
    assert max_samples == 0 or data.n_samples <= max_samples


def test_samples_at_rest_are_not_stale() -> None:
    rest = np.zeros((T.size, 2))
    samples = recording(T, position=rest, velocity=rest, effort=rest + 1.0)
    assert 'sample stale' not in dropped(preprocess(samples))


def test_frozen_state_becomes_a_gap() -> None:
    samples = recording(T)
    position, velocity = samples.position.copy(), samples.velocity.copy()
    position[400:450], velocity[400:450] = position[400], velocity[400]
    data = preprocess(replace(samples, position=position, velocity=velocity))
    assert dropped(data)['sample stale'] == 49
    assert np.unique(data.segment).size == 2
    assert not data.provenance['sources'][0]['retimed']


def test_stamps_far_from_even_ones_stay_as_they_are() -> None:
    """One repetition in a recording with a changing rate proves nothing about its clock."""
    t = np.concatenate([T[:500], T[500] + 0.02 * np.arange(300)])
    samples = recording(t)
    position, velocity = samples.position.copy(), samples.velocity.copy()
    position[100], velocity[100] = position[99], velocity[99]
    data = preprocess(replace(samples, position=position, velocity=velocity))
    assert dropped(data)['sample stale'] == 1
    assert not data.provenance['sources'][0]['retimed']
    assert relative_error(data.ddq, Sinusoids().acceleration(data.t)) < 3e-3


def test_slow_recording_is_not_filtered_and_says_so() -> None:
    data = preprocess(recording(uniform(200, 5.0), Sinusoids(highest_hz=0.2)))
    (source,) = data.provenance['sources']
    assert (source['filtered'], source['rate_hz']) == (False, pytest.approx(5.0))
    truth = Sinusoids(highest_hz=0.2).acceleration(data.t)
    assert relative_error(data.ddq, truth) < 1e-3


def test_provenance_is_json_and_complete() -> None:
    settings = PreprocessingSettings(cutoff_hz=3.0)
    samples = recording(T, counts={'joint missing': 3}, start_ns=12 * 10**9)
    data = preprocess(samples, settings, RecordingSettings(topic='/joint_states'))
    (source,) = json.loads(json.dumps(data.provenance, allow_nan=False))['sources']
    assert source['source'] == 'arm.mcap'
    assert source['topic'] == '/joint_states'
    assert source['start_s'] == 12.0
    assert source['samples'] == 1000
    assert source['dropped']['joint missing'] == 3
    assert source['preprocessing']['cutoff_hz'] == 3.0
    assert source['recording']['topic'] == '/joint_states'
    assert source['velocity'] == 'recorded'


@given(
    st.integers(0, 1000),
    st.floats(0.5, 1000.0),
    st.sampled_from([0.0, 0.5, 4.0, 50.0]),
    st.floats(0.0, 0.5),
)
def test_any_recording_gives_a_data_set_or_a_data_error(
    seed: int, rate: float, cutoff: float, loss: float
) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.exponential(1.0 / rate, rng.integers(1, 400)))
    t = t[rng.uniform(size=t.size) >= loss]
    noise = {name: rng.normal(size=(t.size, 2)) for name in ('position', 'velocity', 'effort')}
    samples = replace(recording(t), **noise)  # type: ignore[arg-type]
    settings = PreprocessingSettings(cutoff_hz=cutoff, min_segment_s=0.0, max_gap_s=10.0 / rate)
    with contextlib.suppress(DataError):
        data = preprocess(samples, settings)
        assert 0 < data.n_samples <= t[-1] * rate * 10 + 1


def test_real_bags_are_consistent(shared_data: Path) -> None:
    """Recorded velocities agree with what positions say, once both are smooth."""
    bags = shared_data / 'unisa_ros2_bags'
    for name, n_stale, dq_least, ddq_least in (
        ('ur10', 0, 0.9999, 0.999),
        ('panda', 14, 0.9999, 0.98),
    ):
        samples = read_bag(bags / name)
        data = preprocess(samples)
        positions_only = preprocess(without_velocity(samples))
        assert dropped(data).get('sample stale', 0) == n_stale
        for joint in range(data.n_joints):
            pair = (data.dq[:, joint], positions_only.dq[:, joint])
            assert np.corrcoef(*pair)[0, 1] > dq_least, name
            pair = (data.ddq[:, joint], positions_only.ddq[:, joint])
            assert np.corrcoef(*pair)[0, 1] > ddq_least, name


@pytest.mark.parametrize('gap_s', [0.0, 5.0])
@pytest.mark.parametrize('is_first', [True, False])
def test_a_faster_part_is_filtered_at_its_own_rate(gap_s: float, is_first: bool) -> None:
    """Ten seconds at 500 Hz beside a minute at 100 Hz: a ripple of 101 Hz would become 1 Hz."""
    fast, slow = uniform(5000, 500.0), uniform(6000, 100.0)
    first, second = (fast, slow) if is_first else (slow, fast)
    t = np.concatenate([first, first[-1] + 0.01 + gap_s + second])
    samples = recording(t)
    is_fast = (t < 10.0) if is_first else (t > 60.0 + gap_s)
    ripple = np.where(is_fast, np.sin(2.0 * np.pi * 101.0 * t), 0.0)[:, np.newaxis]
    rippled = preprocess(replace(samples, effort=samples.effort + ripple))
    inside = np.abs(rippled.t - t[is_fast].mean()) < 4.0
    left = np.abs(rippled.tau - preprocess(samples).tau)[inside]
    assert left.size > 100
    assert left.max() < 0.02
    assert rippled.provenance['sources'][0]['rate_hz'] == pytest.approx(500.0)


def test_bursts_are_resampled_at_no_more_than_twice_their_mean_rate() -> None:
    """Ten messages at once, a microsecond apart, ten times a second: advised is a longer gap."""
    begins = np.repeat(0.1 * np.arange(30), 10)
    t = begins + 1e-6 * np.tile(np.arange(10), 30)
    with pytest.raises(DataError, match=r'raise preprocessing\.max_gap_s'):
        preprocess(recording(t))
    data = preprocess(recording(t), PreprocessingSettings(max_gap_s=1.0, decimate=1))
    (source,) = data.provenance['sources']
    assert source['rate_hz'] == pytest.approx(200.0, rel=0.05)
    assert data.n_samples < 2 * t.size


@pytest.mark.parametrize('cutoff_hz', [0.0, 4.0, 20.0, 45.0])
@pytest.mark.parametrize('velocity', ['recorded', 'differentiated'])
def test_long_segments_are_smoothed_in_windows_alike(
    monkeypatch: pytest.MonkeyPatch, cutoff_hz: float, velocity: str
) -> None:
    rng = np.random.default_rng(0)
    t = uniform(6000, 100.0) + rng.uniform(-3e-3, 3e-3, 6000)
    samples = recording(t)
    samples = replace(samples, effort=samples.effort + rng.standard_normal(samples.effort.shape))
    settings = PreprocessingSettings(cutoff_hz=cutoff_hz, velocity=velocity, decimate=3)
    whole = preprocess(samples, settings)
    monkeypatch.setattr(smoothing, '_WINDOW', 400)
    parts = preprocess(samples, settings)
    np.testing.assert_array_equal(parts.t, whole.t)
    for name in ('q', 'dq', 'ddq', 'tau', 'low_passed_sign'):
        ours, expected = getattr(parts, name), getattr(whole, name)
        np.testing.assert_allclose(ours, expected, atol=1e-12 * np.abs(expected).max())


def test_large_recordings_lie_in_files_and_give_the_same_data(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    t = uniform(3000, 100.0)
    samples = recording(t)
    names = [f'{signal}_{joint}' for signal in ('q', 'dq', 'tau') for joint in samples.joint_names]
    columns = np.column_stack([t, samples.position, samples.velocity, samples.effort])
    path = tmp_path / 'log.csv'
    np.savetxt(path, columns, delimiter=',', header=','.join(['t', *names]), comments='')
    scaled = Config(recording=RecordingSettings(effort_scale=(2.0, 3.0)))
    small = load_dataset(path, scaled)
    monkeypatch.setattr(spill, 'LARGE_BYTES', 10_000)
    monkeypatch.setattr(spill, 'BLOCK_ROWS', 700)
    large = load_dataset(path, scaled)
    for name in ('t', 'q', 'dq', 'ddq', 'tau'):
        np.testing.assert_array_equal(getattr(large, name), getattr(small, name))


def test_repeated_and_quantised_positions_are_told_in_the_provenance() -> None:
    samples = recording(T)
    position = samples.position.copy()
    position[:, 0] = 0.01 * np.round(position[:, 0] / 0.01)
    position[1::2] = position[::2]
    data = preprocess(replace(samples, position=position))
    (source,) = data.provenance['sources']
    assert source['repeated']['positions'] >= T.size // 2
    assert source['repeated']['position_steps'] == {'shoulder': pytest.approx(0.01)}
    (clean,) = preprocess(samples).provenance['sources']
    assert clean['repeated'] == {'positions': 0, 'position_steps': {}}
