"""Positions that wrap or jump, and velocities that contradict them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from preprocessing.motions import (
    recording,
    relative_error,
    Sinusoids,
    uniform,
    without_velocity,
)
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError
from lip_id_ros.health import evidence_of, examine
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.preprocessing.continuity import contradicted, jumps, spikes, TURN, unwrapped
from lip_id_ros.preprocessing.sample_times import changes_of, source_periods
from lip_id_ros.recording import JointSamples, read_bag
from lip_id_ros.recording.reading import read_log
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

MOTION = Sinusoids()
ALL = np.array([True, True])
NAN = np.full((3000, 2), np.nan)


def turning(t: Array) -> JointSamples:
    way = 3.0 * MOTION.position(t)
    return recording(t, position=way, velocity=3.0 * MOTION.velocity(t))


def within_a_turn(samples: JointSamples, least: float = -np.pi) -> JointSamples:
    return replace(samples, position=least + np.mod(samples.position - least, TURN))


def jump_rows(samples: JointSamples) -> list[int]:
    changes = changes_of(samples)
    period = source_periods(changes)['position']
    found: list[int] = jumps(samples, changes['position'], period).tolist()
    return found


@pytest.mark.parametrize('least', [-np.pi, 0.0])
@pytest.mark.parametrize('rate', [20.0, 100.0])
@pytest.mark.parametrize('has_velocity', [True, False])
def test_a_position_in_one_turn_moves_on(has_velocity: bool, rate: float, least: float) -> None:
    samples = turning(uniform(int(30 * rate), rate))
    if not has_velocity:
        samples = without_velocity(samples)
    wrapped = within_a_turn(samples, least)
    assert np.abs(np.diff(wrapped.position, axis=0)).max() > 6.0
    plain, data = preprocess(samples), preprocess(wrapped)
    np.testing.assert_allclose(np.sin(data.q), np.sin(plain.q), atol=1e-9)
    np.testing.assert_allclose(data.dq, plain.dq, atol=1e-7)
    np.testing.assert_allclose(data.ddq, plain.ddq, atol=1e-5)
    (source,) = data.provenance['sources']
    assert source['unwrapped']
    assert source['jumps'] == 0
    found = {each.code for each in examine(evidence_of(wrapped))}
    assert 'position_jump' not in found


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_whole_turns_are_undone_in_blocks_of_any_size(seed: int, rows: int) -> None:
    rng = np.random.default_rng(seed)
    t = uniform(200, 100.0)
    way = np.cumsum(rng.uniform(-1.4, 1.4, (200, 2)), axis=0)
    wrapped = within_a_turn(recording(t, position=way))
    gap = int(rng.integers(1, 200))
    wrapped = replace(wrapped, t=t + 2.0 * (np.arange(200) >= gap))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('lip_id_ros.recording.spill.BLOCK_ROWS', rows)
        found = unwrapped(wrapped, ALL, 1.0).position
    turned = np.ptp(wrapped.position, axis=0) > 0.75 * TURN
    parts = (wrapped.position[:gap], wrapped.position[gap:])
    expected = np.concatenate([np.unwrap(part, axis=0) for part in parts])
    np.testing.assert_allclose(found[:, turned], expected[:, turned], atol=1e-9)


@pytest.mark.parametrize('kind', ['prismatic', 'revolute'])
def test_what_does_not_wrap_stays(kind: str) -> None:
    """Positions of a prismatic joint, and of one that is reported over more than a turn."""
    t = uniform(2000, 100.0)
    way = turning(t).position
    position = way if kind == 'revolute' else within_a_turn(turning(t)).position
    samples = recording(t, position=position)
    assert unwrapped(samples, np.array([kind == 'revolute'] * 2), 1.0) is samples


@pytest.mark.parametrize('has_velocity', [True, False])
def test_motion_is_cut_where_trials_were_joined(has_velocity: bool) -> None:
    """The arm was elsewhere from one sample to the next: 0.4 rad in 10 ms."""
    t = uniform(3000, 100.0)
    samples = recording(t) if has_velocity else recording(t, velocity=NAN)
    position = samples.position.copy()
    position[1500:, 0] += 0.4
    data = preprocess(replace(samples, position=position))
    assert np.unique(data.segment).size == 2
    assert relative_error(2.0 * data.ddq + 0.5 * data.dq, data.tau) < 0.01
    assert data.provenance['sources'][0]['jumps'] == 1
    assert jump_rows(replace(samples, position=position)) == [1500]


def test_a_sample_that_an_encoder_misread_is_left_out() -> None:
    t = uniform(3000, 100.0)
    samples = recording(t, velocity=NAN)
    position = samples.position.copy()
    position[1200, 1] += 1.0
    broken = replace(samples, position=position)
    assert jump_rows(broken) == [1200, 1201]
    data = preprocess(broken)
    assert relative_error(2.0 * data.ddq + 0.5 * data.dq, data.tau) < 0.01


def test_efforts_that_spike_are_left_out() -> None:
    """A hundred times the range in one sample was a torque of a tenth of it for 0.1 s."""
    samples = recording(uniform(3000, 100.0))
    effort = samples.effort.copy()
    effort[[300, 1100, 1101, 2000], 1] = 100.0 * np.ptp(effort)
    data = preprocess(replace(samples, effort=effort))
    assert relative_error(2.0 * data.ddq + 0.5 * data.dq, data.tau) < 0.01
    (source,) = data.provenance['sources']
    assert source['dropped']['effort far from all others'] == 4
    assert source['segments'] == 1
    effort[2500:2510, 0] = 100.0 * np.ptp(samples.effort)
    assert np.flatnonzero(spikes(effort)).tolist() == [300, 1100, 1101, 2000]


@given(st.integers(0, 10_000), st.sampled_from([10.0, 30.0, 125.0, 1000.0]))
def test_a_motion_never_jumps(seed: int, rate: float) -> None:
    rng = np.random.default_rng(seed)
    t = uniform(1000, rate)
    keep = np.sort(rng.choice(1000, 700, replace=False))
    motion = Sinusoids(seed, float(rng.uniform(0.2, 3.0)))
    q = motion.position(t)
    assert jump_rows(recording(t[keep], position=q[keep])) == []
    step = float(rng.choice([1e-4, 0.0015, 0.04]))
    assert jump_rows(recording(t, position=step * np.round(q / step))) == []
    rows = np.arange(1000) // 8 * 8
    assert jump_rows(recording(t, position=q[rows])) == []


@pytest.mark.parametrize('joint', [0, 1])
@pytest.mark.parametrize(
    'wrong', [0.0, -1.0, 180.0 / np.pi, 0.5], ids=['zero', 'sign', 'degrees', 'half']
)
def test_velocities_that_contradict_positions_are_not_used(wrong: float, joint: int) -> None:
    samples = recording(uniform(3000, 100.0))
    velocity = samples.velocity.copy()
    velocity[:, joint] *= wrong
    data = preprocess(replace(samples, velocity=velocity))
    assert relative_error(2.0 * data.ddq + 0.5 * data.dq, data.tau) < 0.02
    (source,) = data.provenance['sources']
    assert source['velocity'] == 'differentiated from position'
    assert source['velocity_contradicted'] == [samples.joint_names[joint]]


@given(st.integers(0, 1000), st.sampled_from([25.0, 100.0, 1000.0]))
def test_velocities_with_noise_delay_and_coarse_positions_are_used(seed: int, rate: float) -> None:
    rng = np.random.default_rng(seed)
    t = np.sort(uniform(2000, rate) + rng.uniform(-0.3, 0.3, 2000) / rate)
    motion = Sinusoids(seed)
    velocity = motion.velocity(t - 0.02) + 0.2 * rng.standard_normal((2000, 2))
    position = 0.001 * np.round(motion.position(t) / 0.001)
    assert contradicted(recording(t, position=position, velocity=velocity)) == ()
    resting = recording(t, position=1e-3 * rng.standard_normal((2000, 2)), velocity=velocity)
    assert contradicted(resting) == ()


def test_of_long_recordings_some_blocks_are_compared() -> None:
    t = uniform(200_000, 1000.0)
    wrong = np.zeros((200_000, 2))
    assert contradicted(recording(t)) == ()
    assert len(contradicted(recording(t, velocity=wrong))) == 2


@pytest.mark.parametrize(
    ('factor', 'unit'), [(1e3, 'in ms'), (1e6, 'in us'), (1e9, 'in ns')], ids=['ms', 'us', 'ns']
)
def test_times_in_another_unit_are_refused(factor: float, unit: str) -> None:
    samples = recording(uniform(3000, 100.0))
    sentence = (
        rf'^arm.mcap must have times in s, but its velocities are .* times the changes of its '
        rf'positions, as if these were {unit}; convert them.$'
    )
    with pytest.raises(DataError, match=sentence):
        preprocess(replace(samples, t=factor * samples.t))


def test_positions_in_degrees_are_refused() -> None:
    samples = recording(uniform(3000, 100.0))
    position, velocity = np.degrees(0.2 * samples.position), 0.2 * samples.velocity
    degrees = replace(samples, position=position, velocity=velocity)
    with pytest.raises(DataError, match=r'must have positions in rad, .* these were in degrees; '):
        preprocess(degrees)


def test_positions_of_most_joints_in_degrees_are_refused_without_velocities() -> None:
    samples = recording(uniform(3000, 100.0))
    degrees = replace(samples, position=np.degrees(samples.position))
    for other in (np.degrees(samples.velocity), np.full_like(samples.velocity, np.nan)):
        with pytest.raises(DataError, match=r'must have positions in rad, but most joints turn'):
            preprocess(replace(degrees, velocity=other))
    one = np.column_stack([degrees.position[:, 0], samples.position[:, 1]])
    preprocess(replace(samples, position=one))


@pytest.mark.parametrize(
    'name',
    ['kuka_lwr_polydoros/kuka_lwr_1.csv', 'panda_gaz2019/exciting.csv', 'unisa_ros2_bags/ur10'],
)
def test_nothing_is_mended_in_real_recordings(shared_data: Path, name: str) -> None:
    path = shared_data / name
    samples = read_log(path) if path.suffix == '.csv' else read_bag(path)
    (source,) = preprocess(samples, PreprocessingSettings(), RecordingSettings()).provenance[
        'sources'
    ]
    assert source['velocity'] == 'recorded'
    assert not source['unwrapped']
    assert source['jumps'] == 0
