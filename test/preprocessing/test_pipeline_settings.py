"""What the settings of preprocessing do, and the sentences about them."""

from __future__ import annotations

from dataclasses import replace

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

from lip_id_ros.errors import ConfigError, DataError, SourceError
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

T = uniform(1000, 100.0)
EVERY = PreprocessingSettings(decimate=1)


def test_the_derivative_is_a_setting() -> None:
    motion = Sinusoids()
    samples = recording(uniform(1000, 30.0), motion)
    errors = []
    for derivative in ('savitzky_golay', 'central_differences'):
        data = preprocess(samples, PreprocessingSettings(derivative=derivative))
        errors.append(relative_error(data.ddq, motion.acceleration(data.t)))
    assert errors[0] < 0.2 * errors[1] < 0.002


def test_recorded_velocities_can_be_left_aside() -> None:
    samples = recording(T)
    wrong = replace(samples, velocity=57.3 * samples.velocity)
    data = preprocess(wrong, PreprocessingSettings(velocity='differentiated'))
    expected = preprocess(without_velocity(samples))
    np.testing.assert_array_equal(data.dq, expected.dq)
    assert data.provenance['sources'][0]['velocity'] == 'differentiated from position'


@pytest.mark.parametrize('periods', [0.0, 0.4, 3.0])
def test_edges_are_a_setting(periods: float) -> None:
    data = preprocess(recording(T), PreprocessingSettings(decimate=1, edge_periods=periods))
    edge = round(periods * 25) + 4
    assert data.n_samples == 1000 - 2 * edge


@pytest.mark.parametrize(('max_gap_s', 'n_segments'), [(0.0, 2), (0.3, 1), (0.05, 2)])
def test_longest_step_within_a_segment_is_a_setting(max_gap_s: float, n_segments: int) -> None:
    t = np.concatenate([T[:400], T[420:]])
    data = preprocess(recording(t), PreprocessingSettings(max_gap_s=max_gap_s))
    assert np.unique(data.segment).size == n_segments


def test_short_segments_and_edges_are_counted() -> None:
    t = np.concatenate([T[:400], T[450:500], T[600:]])
    data = preprocess(recording(t), EVERY)
    edge = 29
    assert dropped(data) == {'segment too short': 50, 'edge of a segment': 4 * edge}
    assert data.n_samples == 800 - 4 * edge
    assert data.t[0] == pytest.approx(T[edge])


def test_decimation_keeps_every_kth_sample_of_a_segment() -> None:
    whole = preprocess(recording(T), EVERY)
    some = preprocess(recording(T), PreprocessingSettings(decimate=7))
    np.testing.assert_array_equal(some.ddq, whole.ddq[::7])


def test_what_the_low_pass_makes_redundant_is_left_out() -> None:
    whole = preprocess(recording(T), EVERY)
    some = preprocess(recording(T))
    k = some.provenance['sources'][0]['kept_every']
    assert k == int(100.0 / (4 * PreprocessingSettings().cutoff))
    np.testing.assert_array_equal(some.q, whole.q[::k])
    unfiltered = preprocess(recording(T), PreprocessingSettings(cutoff_hz=0.0))
    assert unfiltered.provenance['sources'][0]['kept_every'] == 1


def test_limit_spreads_evenly() -> None:
    data = preprocess(recording(T), PreprocessingSettings(decimate=1, max_samples=10))
    whole = preprocess(recording(T), EVERY)
    assert data.n_samples == 10
    assert (data.t[0], data.t[-1]) == (whole.t[0], whole.t[-1])
    assert np.ptp(np.diff(data.t)) < 0.02


def test_effort_is_scaled_and_offset_per_joint() -> None:
    settings = RecordingSettings(
        effort_scale=(13.6, -8.7),
        effort_offset=(0.0, 5.0),
        joint_types=('prismatic', 'revolute'),
        gravity_compensated=True,
    )
    plain = preprocess(recording(T))
    data = preprocess(recording(T), recording=settings)
    np.testing.assert_allclose(data.tau, plain.tau * [13.6, -8.7] + [0.0, 5.0], atol=1e-9)
    assert data.joint_types == ('prismatic', 'revolute')
    assert data.gravity_compensated


def test_no_effort_is_reported() -> None:
    samples = recording(T, effort=np.full((T.size, 2), np.nan))
    sentence = (
        r'^/joint_states in arm.mcap must have effort, but every message leaves it empty; re'
    )
    with pytest.raises(SourceError, match=sentence):
        preprocess(samples)


@pytest.mark.parametrize('name', ['effort_scale', 'effort_offset', 'joint_types'])
def test_setting_of_another_number_of_joints_is_reported(name: str) -> None:
    value = ('revolute',) if name == 'joint_types' else (1.0,)
    settings = RecordingSettings(**{name: value})  # type: ignore[arg-type]
    sentence = rf'^recording.{name} must have one value for each of shoulder, elbow, not 1; give 2'
    with pytest.raises(ConfigError, match=sentence):
        preprocess(recording(T), recording=settings)


def test_an_effort_scale_of_zero_is_refused() -> None:
    settings = RecordingSettings(effort_scale=(2.0, 0.0))
    sentence = r'^recording.effort_scale must not be 0, as it is for elbow: .*; give 1 where'
    with pytest.raises(ConfigError, match=sentence):
        preprocess(recording(T), recording=settings)


@pytest.mark.parametrize('count', [1, 2, 40, 57])
def test_too_short_a_recording_is_reported(count: int) -> None:
    with pytest.raises(DataError, match=r'^arm.mcap must hold .*; record'):
        preprocess(recording(T[:count]))


def test_two_samples_that_are_all_spikes_are_refused() -> None:
    samples = recording(T[:2])
    effort = np.array([[0.0, 0.0], [1e3, 0.0]])
    with pytest.raises(DataError, match='without spikes of the effort, but has 0; record'):
        preprocess(replace(samples, effort=effort))


def test_sentence_for_a_single_sample() -> None:
    sentence = r'^arm.mcap must hold at least two different samples, but has 1; record while the a'
    with pytest.raises(DataError, match=sentence):
        preprocess(recording(T[:1]))


@pytest.mark.parametrize(
    ('settings', 'sentence'),
    [
        (
            {'min_segment_s': 20.0},
            r'a motion of 20 s without a gap, but the longest of 1 lasts 9.99 s',
        ),
        (
            {'cutoff_hz': 0.1},
            r'a motion of 20.08 s without a gap, but the longest of 1 lasts 9.99 s',
        ),
        ({'max_gap_s': 1e-5}, r'a motion of 1 s without a gap, but the longest of 1000 lasts 0 s'),
    ],
)
def test_sentence_for_segments_too_short(settings: dict[str, float], sentence: str) -> None:
    with pytest.raises(DataError, match=sentence):
        preprocess(recording(T), PreprocessingSettings(**settings))  # type: ignore[arg-type]


@pytest.mark.parametrize(('seconds', 'is_kept'), [(1.05, True), (0.95, False)])
def test_segments_shorter_than_the_setting_are_dropped(seconds: float, is_kept: bool) -> None:
    """Although they have samples enough between their edges."""
    t = np.concatenate([uniform(300, 100.0), 10.0 + uniform(int(100 * seconds), 100.0)])
    data = preprocess(recording(t), PreprocessingSettings(cutoff_hz=20.0, min_segment_s=1.0))
    assert (np.unique(data.segment).size == 2) == is_kept
    assert (dropped(data).get('segment too short', 0) == 0) == is_kept
