"""Stamps that jitter, messages that are lost, and messages that come in bursts."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from preprocessing.motions import recording, relative_error, Sinusoids, uniform
import pytest

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.preprocessing.sample_times import isotonic, retimed
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import PreprocessingSettings

MOTION = Sinusoids(highest_hz=1.5)
SECONDS = 20.0
JITTER = 0.2
LOST = 0.05


def jittered(rate: float, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    t = uniform(int(SECONDS * rate), rate)
    shifted: Array = np.sort(t + JITTER / rate * rng.standard_normal(t.size))
    shifted -= shifted[0]
    return shifted


def received(size: int, lost: float, seed: int = 1) -> BoolArray:
    keep: BoolArray = np.random.default_rng(seed).uniform(size=size) >= lost
    keep[[0, -1]] = True
    return keep


def law_error(data: Dataset) -> float:
    """Return the error of torques at their motion, which a common shift in time leaves alone."""
    return relative_error(2.0 * data.ddq + 0.5 * data.dq, data.tau)


def positions_only(t: Array) -> JointSamples:
    """Record at times t, with positions of an encoder of 17 bits and noisy efforts."""
    step = 2.0 * np.pi / 2**17
    samples = recording(t, MOTION)
    noise = 0.02 * samples.effort.std() * np.random.default_rng(2).standard_normal((t.size, 2))
    return replace(
        samples,
        position=step * np.round(samples.position / step),
        velocity=np.full_like(samples.velocity, np.nan),
        effort=samples.effort + noise,
    )


@pytest.mark.parametrize('rate', [30.0, 100.0, 500.0])
@pytest.mark.parametrize('lost', [0.0, LOST])
def test_stamps_that_jitter_while_sensors_do_not_are_mended(rate: float, lost: float) -> None:
    """Held-out errors would be up to 20 times those of the clean recording."""
    clean = positions_only(uniform(int(SECONDS * rate), rate))
    keep = received(clean.n_samples, lost)
    some = clean.select(keep)
    stamped = replace(some, t=jittered(rate)[keep])
    data = preprocess(stamped)
    assert data.provenance['sources'][0]['retimed']
    assert law_error(data) < 1.5 * law_error(preprocess(some))


@pytest.mark.parametrize('rate', [30.0, 100.0, 500.0])
def test_true_stamps_stay_however_uneven(rate: float) -> None:
    t = jittered(rate)
    samples = positions_only(t)
    assert retimed(t, samples.position) is t
    assert not preprocess(samples).provenance['sources'][0]['retimed']


def test_stamps_stay_where_the_arm_stands() -> None:
    t = jittered(100.0)
    assert retimed(t, np.ones((t.size, 2))) is t


@pytest.mark.parametrize('burst', [3, 5, 10])
def test_messages_received_in_bursts_are_spread_evenly(burst: int) -> None:
    clean = positions_only(uniform(int(SECONDS * 100), 100.0))
    number, place = np.divmod(np.arange(clean.n_samples), burst)
    data = preprocess(replace(clean, t=0.01 * burst * number + 1e-4 * place))
    assert np.unique(data.segment).size == 1
    assert data.provenance['sources'][0]['rate_hz'] == pytest.approx(100.0, rel=0.01)
    assert law_error(data) < 1.1 * law_error(preprocess(clean))


def test_pauses_between_bursts_are_gaps() -> None:
    clean = positions_only(uniform(2000, 100.0))
    number, place = np.divmod(np.arange(clean.n_samples), 5)
    t = 0.05 * number + 1e-4 * place + 3.0 * (number >= 200)
    data = preprocess(replace(clean, t=t))
    assert np.unique(data.segment).size == 2


def test_short_losses_at_a_high_rate_are_no_gaps() -> None:
    """20 ms, ten steps, are a twelfth of the period that the low-pass keeps."""
    samples = positions_only(uniform(10_000, 500.0))
    keep = np.ones(samples.n_samples, bool)
    for start in range(300, 9900, 300):
        keep[start : start + 9] = False
    some = samples.select(keep)
    data = preprocess(some)
    assert np.unique(data.segment).size == 1
    assert law_error(data) < 1.2 * law_error(preprocess(samples))
    with pytest.raises(DataError, match='without a gap'):
        preprocess(some, PreprocessingSettings(cutoff_hz=0.0))


optimize = pytest.importorskip('scipy.optimize')


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=50))
def test_values_are_those_of_scipy(values: list[float]) -> None:
    if not hasattr(optimize, 'isotonic_regression'):
        pytest.skip('SciPy has isotonic_regression from 1.12 on')
    expected = optimize.isotonic_regression(np.array(values)).x
    assert isotonic(np.array(values)) == pytest.approx(expected, abs=1e-9)
