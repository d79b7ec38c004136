"""Cut-offs and delays that are selected, on simulated recordings whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from loading.simulated import N_JOINTS, simulated, SimulatedRecording
import numpy as np
from preprocessing.motions import recording, uniform
import pytest

from lip_id_ros.errors import ConfigError
from lip_id_ros.evaluation import data_remarks
from lip_id_ros.loading import load_dataset, with_selected
from lip_id_ros.loading.data_settings import (
    CUTOFFS_HZ,
    first_share,
    select_preprocessing,
    Selected,
)
from lip_id_ros.loading.delay_selection import fewest
from lip_id_ros.loading.left_out_torques import LeftOutTorques
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import AUTO, Config, PreprocessingSettings, RecordingSettings

AUTOMATIC = PreprocessingSettings(cutoff_hz=AUTO)
NONE = np.zeros(N_JOINTS)


def selected(recorded: SimulatedRecording) -> Selected:
    return select_preprocessing([recorded.samples], AUTOMATIC, RecordingSettings())


@pytest.mark.slow
def test_the_delay_of_one_drive_is_recovered() -> None:
    delays = np.zeros(N_JOINTS)
    delays[1] = 0.008
    found = selected(simulated(1, delays)).recording.effort_delay_s
    np.testing.assert_allclose(found, delays, atol=1e-3)


@pytest.mark.slow
def test_a_common_delay_beyond_that_of_single_drives_is_recovered() -> None:
    found = selected(simulated(0, np.full(N_JOINTS, -0.055))).recording.effort_delay_s
    np.testing.assert_allclose(found, -0.055, atol=2e-3)


@pytest.mark.slow
def test_a_drive_that_is_later_than_all_others_is_recovered() -> None:
    delays = np.full(N_JOINTS, 0.04)
    delays[1] += 0.01
    found = selected(simulated(0, delays)).recording.effort_delay_s
    np.testing.assert_allclose(found, delays, atol=2e-3)


@pytest.mark.slow
def test_no_delay_is_invented_and_noise_lowers_the_cutoff() -> None:
    clean, noisy = (selected(simulated(2, NONE, noise, 40)) for noise in (0.0, 2e-3))
    assert clean.recording.effort_delay_s == ()
    assert noisy.recording.effort_delay_s == ()
    assert noisy.preprocessing.cutoff < clean.preprocessing.cutoff


@pytest.mark.slow
@pytest.mark.parametrize('noise', [2e-5, 5e-4])
def test_the_cutoff_is_near_the_best_in_truth(noise: float) -> None:
    recorded = simulated(3, NONE, noise, 40, coulomb=0.0)
    errors = [true_error(recorded, cutoff) for cutoff in CUTOFFS_HZ]
    found = selected(recorded).preprocessing.cutoff
    best = min(errors)
    assert errors[CUTOFFS_HZ.index(found)] < 1.2 * best
    assert max(errors) > 4.0 * best


def true_error(recorded: SimulatedRecording, cutoff: float) -> float:
    """Return the error of true torques at filtered states, in the mean over joints."""
    settings = PreprocessingSettings(cutoff_hz=cutoff, decimate=1)
    data = preprocess(recorded.samples, settings)
    inner = (data.t > 1.5) & (data.t < data.t[-1] - 1.5)
    truth = recorded.torque(*recorded.motion.sample(data.t[inner]))
    found = recorded.torque(data.q[inner], data.dq[inner], data.ddq[inner])
    return float(np.mean(np.std(found - truth, axis=0) / truth.std(axis=0)))


@pytest.mark.parametrize('delay_s', [0.0137, 0.3, -0.3])
def test_efforts_are_shifted_back_to_the_ends_of_a_segment(delay_s: float) -> None:
    t = uniform(3000, 100.0)
    late = np.array([0.0, delay_s])
    samples = recording(t)
    torque = np.stack([recording(t - d).effort[:, j] for j, d in enumerate(late)], axis=1)
    delayed = replace(samples, effort=torque)
    settings = RecordingSettings(effort_delay_s=tuple(late))
    data = preprocess(delayed, recording=settings)
    assert data.n_samples > 0.9 * preprocess(samples).n_samples
    exact = preprocess(samples, PreprocessingSettings(decimate=1))
    rows = np.rint((data.t - exact.t[0]) * 100.0).astype(int)
    np.testing.assert_allclose(data.tau, exact.tau[rows], atol=2e-3 * np.ptp(exact.tau))
    np.testing.assert_array_equal(data.q, exact.q[rows])


def test_what_is_left_unexplained_is_a_geometric_mean_of_joints() -> None:
    judge = LeftOutTorques.__new__(LeftOutTorques)
    judge._size = np.array([10.0, 1.0])
    squares = np.array([[0.5, 0.36], [1.5, 0.36]])  # of two blocks: 1 and 36 % of the variances
    assert judge.percent(squares) == pytest.approx(6.0)


def test_delays_of_single_joints_or_one_of_all_whichever_are_fewer() -> None:
    error, most = np.full(4, 1e-3), 4.0
    one = np.array([0.0, 0.009, 0.001, 0.0])
    np.testing.assert_array_equal(fewest(0.0025, 1e-4, one, error, most), [0.0, 0.009, 0.0, 0.0])
    alike = np.array([0.011, 0.009, 0.010, 0.016])
    np.testing.assert_array_equal(
        fewest(0.0105, 1e-4, alike, error, most), [0.0105, 0.0105, 0.0105, 0.016]
    )
    as_many = np.array([0.010, 0.010, 0.001])
    np.testing.assert_array_equal(
        fewest(0.0105, 1e-4, as_many, error[:3], most), [0.010, 0.010, 0.0]
    )
    unsure = np.array([0.002, 0.001, 0.002, 0.003])  # together they are sure
    np.testing.assert_array_equal(fewest(0.002, 1e-4, unsure, error, most), np.full(4, 0.002))
    np.testing.assert_array_equal(fewest(0.002, 1e-3, unsure, error, most), np.zeros(4))
    tiny = np.full(4, 4e-4)
    np.testing.assert_array_equal(fewest(4e-4, 1e-6, tiny, 1e-3 * tiny, most), np.zeros(4))
    lost = np.array([np.inf, 1e-3, 1e-3, 1e-3])
    np.testing.assert_array_equal(fewest(0.0, np.inf, one, lost, most), [0.0, 0.009, 0.0, 0.0])


def log(path: Path, motion: float, n: int) -> Path:
    rng = np.random.default_rng(1)
    t = uniform(n, 100.0) + motion
    samples = recording(t)
    effort = samples.effort + 0.01 * rng.standard_normal(samples.effort.shape)
    columns = {'t': t - motion, 'q_a': samples.position[:, 0], 'q_b': samples.position[:, 1]}
    columns |= {'tau_a': effort[:, 0], 'tau_b': effort[:, 1]}
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=',', header=','.join(columns), comments='')
    return path


@pytest.mark.slow
def test_what_is_held_out_does_not_matter(tmp_path: Path) -> None:
    good = log(tmp_path / 'good.csv', 0.0, 3000)
    table = np.loadtxt(good, delimiter=',', skiprows=1)
    table[2000:, 1:] += np.random.default_rng(0).standard_normal(table[2000:, 1:].shape)
    spoilt = tmp_path / 'spoilt.csv'
    np.savetxt(spoilt, table, delimiter=',', header='t,q_a,q_b,tau_a,tau_b', comments='')
    config = Config(preprocessing=AUTOMATIC)
    share = 2.0 / 3.0
    reports = [
        load_dataset(path, config, training_share=share).provenance['sources'][0]
        for path in (good, spoilt)
    ]
    assert reports[0]['elected'] == reports[1]['elected']
    assert (
        'Preprocessing selected by cross-validation: cut-off'
        in data_remarks({'sources': reports})[0]
    )
    again = with_selected(config, {'sources': reports})
    assert again.preprocessing.cutoff == reports[0]['preprocessing']['cutoff_hz']
    assert load_dataset(good, again).provenance['sources'][0]['recording'] == (
        reports[0]['recording'] | {'effort_delay_s': again.recording.effort_delay_s}
    )


def test_other_recordings_get_all_that_was_selected() -> None:
    preprocessing: dict[str, Any] = {'cutoff_hz': 3.0, 'derivative': 'central_differences'}
    recording = {'effort_delay_s': [0.01, 0.0], 'effort_scale': [2.0, 2.0]}
    source = {'preprocessing': preprocessing, 'recording': recording}
    found = with_selected(Config(preprocessing=AUTOMATIC), {'sources': [source]})
    assert found.preprocessing == replace(AUTOMATIC, **preprocessing)
    assert found.recording == RecordingSettings(effort_delay_s=(0.01, 0.0))


def test_the_first_share_is_one_of_time() -> None:
    """Messages that come more often do not move the cut; time in which there are none is none."""
    slow, fast = np.arange(0.0, 40.0, 0.01), np.arange(40.0, 100.0, 0.001)
    t = np.concatenate([slow, fast[fast < 60.0], 1000.0 + fast[fast >= 60.0]])
    values = np.zeros((t.size, 1))
    samples = JointSamples(t, values, values, values, ('a',))
    for share, last in ((0.2, 20.0), (0.5, 50.0), (0.8, 1080.0), (1.0, t[-1])):
        (first,) = first_share([samples], share)
        assert first.t[-1] == pytest.approx(last, abs=0.02)
    first, second = first_share([samples.rows(slice(0, 4000)), samples], 0.5)
    assert second.t[-1] == pytest.approx(30.0, abs=0.02)
    assert first.n_samples == 4000


def test_few_samples_keep_the_usual_cutoff(tmp_path: Path) -> None:
    data = load_dataset(log(tmp_path / 'short.csv', 0.0, 150), Config(preprocessing=AUTOMATIC))
    (source,) = data.provenance['sources']
    assert source['preprocessing']['cutoff_hz'] == PreprocessingSettings().cutoff
    assert 'too few to select' in data_remarks(data.provenance)[0]


def test_mixed_settings_are_refused(tmp_path: Path) -> None:
    samples = recording(uniform(500, 100.0))
    derivative = replace(AUTOMATIC, derivative='central_differences')
    with pytest.raises(ConfigError, match=r'-1 selects preprocessing\.derivative too'):
        select_preprocessing([samples], derivative, RecordingSettings())
    delays = RecordingSettings(effort_delay_s=(0.0, 0.01))
    with pytest.raises(ConfigError, match=r'-1 selects recording\.effort_delay_s too'):
        select_preprocessing([samples], AUTOMATIC, delays)
    other = replace(samples, joint_names=('elbow', 'shoulder'))
    with pytest.raises(ConfigError, match='one order of joints'):
        select_preprocessing([samples, other], AUTOMATIC, RecordingSettings())
    with pytest.raises(ConfigError, match='where samples are smoothed, not -1'):
        preprocess(samples, AUTOMATIC)
    with pytest.raises(ConfigError, match='were no recordings'):
        with_selected(Config(preprocessing=AUTOMATIC), {'sources': [{'source': 'arrays'}]})


def test_values_that_are_no_cutoff_are_refused() -> None:
    for value in ('automatic', -2.0, True, None):
        with pytest.raises(ConfigError, match=r'cutoff_hz must be a number >= -1 Hz, not'):
            PreprocessingSettings(cutoff_hz=value)  # type: ignore[arg-type]
