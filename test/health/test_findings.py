"""Every kind of finding, on a recording that has just this defect, and on sound ones."""

from __future__ import annotations

from dataclasses import replace

from health.defects import (
    absent,
    Break,
    constant,
    DEFECTS,
    JOINT,
    SAID,
    times,
)
from health.recordings import (
    codes,
    column,
    delayed,
    found,
    moved,
    NAMES,
    RATE,
    rows,
    sound,
)
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.signal import butter, lfilter

from lip_id_ros.errors import ConfigError
from lip_id_ros.health import CHECKS, evidence_of, examine
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings


@pytest.mark.parametrize('friction', [0.0, 1.0])
@pytest.mark.parametrize('seed', range(4))
def test_nothing_is_found_in_a_sound_recording(seed: int, friction: float) -> None:
    assert found(sound(seed, friction)) == ()


@pytest.mark.parametrize('code', [check.code for check in CHECKS])
def test_a_defect_is_found_and_nothing_else(code: str) -> None:
    spoil, others = DEFECTS[code]
    for seed in range(2):
        findings = found(spoil(sound(seed)))
        texts = [each.text for each in findings if each.code == code]
        assert texts
        assert {each.code for each in findings} <= {code} | others
        assert seed or SAID.get(code, '') in texts[0]


def test_findings_name_the_joint_and_say_what_to_do() -> None:
    (finding,) = found(DEFECTS['velocity_scale'][0](sound()))
    assert finding.joint == NAMES[JOINT]
    assert finding.severity == 'warning'
    assert finding.text == (
        'the velocity of arm_joint5 is 57.3 times the change of its position, as if in degrees '
        'per second; correct the velocities or the times (positions are differentiated instead).'
    )


def test_what_matters_most_comes_first() -> None:
    broken = absent('velocity')(constant('effort')(DEFECTS['still'][0](sound())))
    severities = [finding.severity for finding in found(broken)]
    assert severities == sorted(severities, key=['error', 'warning', 'note'].index)
    assert len(set(severities)) == 3


def test_a_joint_that_stands_still_hides_nothing_of_the_others() -> None:
    still = moved(sound(), 0, np.ones(sound().n_samples), np.zeros(sound().n_samples))
    assert codes(still) == {'still'}
    assert codes(times('effort', -1.0)(still)) == {'still', 'effort_sign'}


def test_a_prismatic_joint_in_millimetres_is_found() -> None:
    samples = moved(
        sound(), JOINT, 1e3 * sound().position[:, JOINT], 1e3 * sound().velocity[:, JOINT]
    )
    prismatic = RecordingSettings(joint_types=('prismatic',) * 7)
    units = [
        each for each in examine(evidence_of(samples, prismatic)) if each.code == 'position_unit'
    ]
    (finding,) = units
    assert finding.joint == NAMES[JOINT]
    assert finding.text.endswith(
        ' m; see whether positions are in degrees or mm, and publish them in rad and m.'
    )


@pytest.mark.parametrize('joint', range(7))
def test_the_sign_of_every_joint_is_judged(joint: int) -> None:
    turned = column(sound(), 'effort', joint, -sound().effort[:, joint])
    assert {(each.code, each.joint) for each in found(turned)} == {('effort_sign', NAMES[joint])}


@pytest.mark.parametrize('joint', range(6))
def test_exchanged_efforts_of_neighbours_are_found(joint: int) -> None:
    order = np.arange(7)
    order[[joint, joint + 1]] = joint + 1, joint
    exchanged = replace(sound(), effort=sound().effort[:, order])
    assert ('effort_exchanged', NAMES[joint]) in {(x.code, x.joint) for x in found(exchanged)}


@pytest.mark.parametrize('delay', [-0.08, -0.04, 0.04, 0.08])
def test_delay_of_the_efforts_is_measured(delay: float) -> None:
    lags = evidence_of(delayed(sound(seconds=60.0), 'effort', delay)).lags
    assert lags is not None
    assert lags.lag_s == pytest.approx(delay, abs=0.015)


def test_the_delay_of_one_joint_is_found() -> None:
    samples = sound(seconds=150.0)
    assert found(samples) == ()
    late = delayed(samples, 'effort', 0.06).effort[:, JOINT]
    (finding,) = found(column(samples, 'effort', JOINT, late))
    assert (finding.code, finding.joint) == ('effort_delay', NAMES[JOINT])


def test_low_passed_positions_make_efforts_early() -> None:
    samples = sound(seconds=60.0)
    low = butter(1, 3.0, fs=RATE)
    start = samples.position[0]
    position = start + lfilter(*low, samples.position - start, axis=0)
    velocity = lfilter(*low, samples.velocity, axis=0)
    late = found(replace(samples, position=position, velocity=velocity))
    (finding,) = (each for each in late if each.severity != 'note')
    assert finding.code == 'effort_delay'
    assert 'ahead of the motion' in finding.text


@pytest.mark.parametrize('delay', [-0.05, 0.012, 0.05])
def test_delay_of_the_velocities_is_measured(delay: float) -> None:
    agreement = evidence_of(delayed(sound(), 'velocity', delay)).agreement
    assert agreement is not None
    np.testing.assert_allclose(agreement.lag_s, delay, atol=1e-3)


def test_settings_say_what_efforts_and_joints_are() -> None:
    turned = replace(sound(), effort=-0.01 * sound().effort)
    right = RecordingSettings(effort_scale=(-100.0,) * 7)
    assert {'effort_sign', 'effort_small'} <= codes(turned)
    assert examine(evidence_of(turned, right)) == ()
    prismatic = RecordingSettings(joint_types=('prismatic',) * 7)
    little = DEFECTS['little_range'][0](sound())
    assert 'little_range' not in {each.code for each in examine(evidence_of(little, prismatic))}


@pytest.mark.parametrize(('value', 'noise'), [(0.0, 1e-7), (0.0, 0.0), (40.0, 1e-5)])
def test_a_constant_effort_with_noise_is_constant(value: float, noise: float) -> None:
    """The motion explains nothing of such noise, which need not belong to another joint."""
    draws = np.random.default_rng(0).uniform(-1.0, 1.0, sound().n_samples)
    (finding,) = found(column(sound(), 'effort', JOINT, value + noise * draws))
    assert finding.code == 'effort_constant'
    assert (f'is {value:g} throughout' in finding.text) == (noise == 0.0)
    assert (f'changes by {2.0 * noise:.1g} only' in finding.text) == (noise > 0.0)


def test_settings_for_other_joints_are_told() -> None:
    with pytest.raises(ConfigError, match=r'^recording.effort_scale must have one value for each'):
        evidence_of(sound(), RecordingSettings(effort_scale=(1.0,)))


@pytest.mark.parametrize(
    ('names', 'is_found'),
    [
        (('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint', 'wrist_1_joint'), False),
        (('elbow_joint', 'shoulder_lift_joint', 'shoulder_pan_joint', 'wrist_1_joint'), True),
        (('joint_1', 'joint_2', 'joint_10'), False),
        (('joint_1', 'joint_10', 'joint_2'), True),
        (('left_shoulder', 'left_wrist', 'right_shoulder', 'right_wrist'), False),
        (('FR_hip', 'FR_thigh', 'FR_calf', 'FL_hip'), False),
    ],
)
def test_order_of_joints_by_their_names(names: tuple[str, ...], is_found: bool) -> None:
    zeros = np.zeros((0, len(names)))
    samples = JointSamples(np.zeros(0), zeros, zeros, zeros, names)
    assert ('joint_order' in codes(samples)) == is_found


@settings(max_examples=100)
@given(
    st.integers(0, 10_000),
    st.integers(0, 300),
    st.integers(1, 3),
    st.sampled_from([0.0, 1e-300, 1.0, 1e300]),
)
def test_any_recording_can_be_examined(seed: int, count: int, n_joints: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.exponential(0.02, count))
    parts = [scale * rng.normal(size=(count, n_joints)) for _ in range(3)]
    for part in parts[1:]:
        if rng.uniform() < 0.3:
            part[:] = np.nan
    names = tuple(f'j{number}' for number in range(n_joints))
    position, velocity, effort = parts
    for finding in found(JointSamples(t, position, velocity, effort, names)):
        assert 'nan' not in finding.text.split()
        assert finding.text.endswith('.')


def cut_off(seconds: float) -> Break:
    return lambda samples: rows(samples, samples.t <= seconds)


def stopped(seconds: float) -> Break:
    def stop(samples: JointSamples) -> JointSamples:
        count = round(seconds * RATE) + 1
        position = samples.position[:, JOINT]
        windows = np.lib.stride_tricks.sliding_window_view(position, count)
        start = int(np.argmax(np.ptp(windows[:-1], axis=1)))
        effort = samples.effort[:, JOINT].copy()
        effort[start : start + count] = effort[start]
        return column(samples, 'effort', JOINT, effort)

    return stop


LIMITS: dict[str, tuple[Break, Break]] = {
    'short': (cut_off(20.1), cut_off(19.9)),
    'velocity_delay': (
        lambda samples: delayed(samples, 'velocity', 0.008),
        lambda samples: delayed(samples, 'velocity', 0.012),
    ),
    'velocity_scale': (times('velocity', 1.07), times('velocity', 1.09)),
    'frozen': (stopped(0.9), stopped(1.1)),
}


@pytest.mark.parametrize('code', LIMITS)
def test_limits_are_those_of_the_documentation(code: str) -> None:
    inside, beyond = LIMITS[code]
    assert code not in codes(inside(sound()))
    assert code in codes(beyond(sound()))


@pytest.mark.parametrize(
    ('signal', 'share', 'is_coarse'),
    [
        ('position', 0.005, False),
        ('position', 0.03, True),
        ('velocity', 0.05, False),
        ('velocity', 0.2, True),
        ('effort', 0.05, False),
        ('effort', 0.2, True),
    ],
)
def test_steps_are_coarse_beside_the_deviation_of_their_signal(
    signal: str, share: float, is_coarse: bool
) -> None:
    samples = sound()
    values = getattr(samples, signal)[:, JOINT]
    step = share * values.std()
    kinds = codes(column(samples, signal, JOINT, step * np.round(values / step)))
    assert ('coarse' in kinds) is is_coarse
