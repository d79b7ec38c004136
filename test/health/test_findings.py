"""Every kind of finding, on a recording that has just this defect, and on sound ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

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

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.health import CHECKS, evidence_of, examine, serious
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings

Break = Callable[[JointSamples], JointSamples]
JOINT = 4


def jittered(samples: JointSamples) -> JointSamples:
    rng = np.random.default_rng(0)
    shift = rng.uniform(-0.45, 0.45, samples.t.size) / RATE
    t = samples.t + shift
    signals: dict[str, Any] = {
        name: np.column_stack([np.interp(t, samples.t, c) for c in getattr(samples, name).T])
        for name in ('position', 'velocity', 'effort')
    }
    return replace(samples, t=t, **signals)


def with_gaps(samples: JointSamples) -> JointSamples:
    return rows(samples, np.arange(samples.n_samples) % 500 > 20)


def repeating(samples: JointSamples) -> JointSamples:
    source = np.arange(samples.n_samples)
    source[::20] = np.maximum(source[::20] - 1, 0)
    return replace(rows(samples, source), t=samples.t)


def with_outliers(samples: JointSamples) -> JointSamples:
    effort = samples.effort[:, JOINT].copy()
    effort[[700, 1500, 2300]] = 40.0 * np.ptp(effort)
    return column(samples, 'effort', JOINT, effort)


def in_degrees(samples: JointSamples) -> JointSamples:
    factor = 180.0 / np.pi
    return moved(
        samples, JOINT, factor * samples.position[:, JOINT], factor * samples.velocity[:, JOINT]
    )


def random_velocity(samples: JointSamples) -> JointSamples:
    noise = np.random.default_rng(1).standard_normal(samples.n_samples)
    return column(samples, 'velocity', JOINT, noise)


def clipped(samples: JointSamples) -> JointSamples:
    effort = samples.effort[:, JOINT]
    return column(samples, 'effort', JOINT, np.clip(effort, *np.percentile(effort, [10, 90])))


def unrelated(samples: JointSamples) -> JointSamples:
    noise = np.random.default_rng(1).standard_normal(samples.n_samples)
    return column(samples, 'effort', JOINT, noise)


def frozen(signal: str) -> Break:
    def stop(samples: JointSamples) -> JointSamples:
        values = getattr(samples, signal)[:, JOINT].copy()
        values[1000:1300] = values[1000]
        return column(samples, signal, JOINT, values)

    return stop


def resting(samples: JointSamples) -> JointSamples:
    """Hold the last posture for longer than the motion lasted."""
    extra = 5000
    noise = np.random.default_rng(0).standard_normal((2, extra, samples.n_joints))

    def held(values: Array) -> Array:
        return np.repeat(values[-1:], extra, axis=0)

    position = np.concatenate([samples.position, held(samples.position) + 1e-6 * noise[0]])
    velocity = np.concatenate([samples.velocity, 1e-5 * noise[1]])
    effort = np.concatenate([samples.effort, held(samples.effort) + 1e-2 * noise[0]])
    t = np.arange(len(position)) / RATE
    return replace(samples, t=t, position=position, velocity=velocity, effort=effort)


def small_motion(factor: float) -> Break:
    def shrink(samples: JointSamples) -> JointSamples:
        q, dq = samples.position[:, JOINT], samples.velocity[:, JOINT]
        return moved(samples, JOINT, q.mean() + factor * (q - q.mean()), factor * dq)

    return shrink


def slowed(samples: JointSamples) -> JointSamples:
    """Let a joint creep to and fro over a wide range."""
    rate = 2 * np.pi / 40.0
    q, dq = 0.2 * np.sin(rate * samples.t), 0.2 * rate * np.cos(rate * samples.t)
    return moved(samples, JOINT, q, dq)


def gentle(samples: JointSamples) -> JointSamples:
    rate = 2 * np.pi / 10.0
    q, dq = np.sin(rate * samples.t), rate * np.cos(rate * samples.t)
    return moved(samples, JOINT, q, dq)


def one_way(samples: JointSamples) -> JointSamples:
    rate = 2 * np.pi / 4.0
    dq = 0.5 + 0.45 * np.sin(rate * samples.t)
    q = 0.5 * samples.t - 0.45 / rate * np.cos(rate * samples.t)
    return moved(samples, JOINT, q, dq)


def together(samples: JointSamples) -> JointSamples:
    return moved(samples, JOINT, -0.5 * samples.position[:, 1], -0.5 * samples.velocity[:, 1])


def renamed(names: tuple[str, ...]) -> Break:
    return lambda samples: replace(samples, joint_names=names)


def absent(signal: str) -> Break:
    def leave_out(samples: JointSamples) -> JointSamples:
        changed: dict[str, Any] = {signal: np.full_like(samples.effort, np.nan)}
        return replace(samples, **changed)

    return leave_out


def constant(signal: str) -> Break:
    return lambda samples: column(samples, signal, JOINT, 0.0)


def times(signal: str, factor: float) -> Break:
    return lambda samples: column(
        samples, signal, JOINT, factor * getattr(samples, signal)[:, JOINT]
    )


def rounded(signal: str, step: float) -> Break:
    return lambda samples: column(
        samples, signal, JOINT, step * np.round(getattr(samples, signal)[:, JOINT] / step)
    )


# code: how to break a sound recording, and what else may then be found
DEFECTS: dict[str, tuple[Break, set[str]]] = {
    'short': (lambda samples: rows(samples, slice(0, 1500)), set()),
    'low_rate': (lambda samples: rows(samples, slice(None, None, 10)), set()),
    'jitter': (jittered, set()),
    'gaps': (with_gaps, set()),
    'dropped': (lambda samples: replace(samples, counts={'joint missing': 100}), set()),
    'stale': (repeating, set()),
    'outliers': (with_outliers, set()),
    'position_unit': (in_degrees, set()),
    'velocity_missing': (absent('velocity'), set()),
    'velocity_constant': (constant('velocity'), set()),
    'velocity_sign': (times('velocity', -1.0), set()),
    'velocity_scale': (times('velocity', 180 / np.pi), set()),
    'velocity_unlike': (random_velocity, set()),
    'velocity_delay': (lambda samples: delayed(samples, 'velocity', 0.03), set()),
    'effort_missing': (absent('effort'), set()),
    'effort_constant': (constant('effort'), set()),
    'effort_clipped': (clipped, set()),
    'effort_sign': (times('effort', -1.0), set()),
    'effort_unrelated': (unrelated, set()),
    'effort_delay': (lambda samples: delayed(samples, 'effort', 0.06), set()),
    'effort_small': (lambda samples: replace(samples, effort=0.03 * samples.effort), set()),
    'effort_huge': (times('effort', 1e4), set()),
    'coarse': (rounded('effort', 0.5), set()),
    'frozen': (frozen('effort'), set()),
    'position_frozen': (frozen('position'), set()),
    'still': (small_motion(1e-6), set()),
    'little_range': (small_motion(0.05), {'gentle', 'slow'}),
    'slow': (slowed, {'gentle'}),
    'gentle': (gentle, set()),
    'one_way': (one_way, set()),
    'together': (together, set()),
    'resting': (resting, set()),
    'joint_order': (renamed(tuple(sorted(f'arm_joint{n}' for n in range(5, 12)))), set()),
    'gripper_joint': (renamed((*NAMES[:-1], 'panda_finger_joint1')), set()),
}


@pytest.mark.parametrize('friction', [0.0, 1.0])
@pytest.mark.parametrize('seed', range(4))
def test_nothing_is_found_in_a_sound_recording(seed: int, friction: float) -> None:
    assert found(sound(seed, friction)) == ()


@pytest.mark.parametrize('code', [check.code for check in CHECKS])
def test_a_defect_is_found_and_nothing_else(code: str) -> None:
    spoil, others = DEFECTS[code]
    for seed in range(2):
        kinds = codes(spoil(sound(seed)))
        assert code in kinds
        assert kinds <= {code} | others


def test_findings_name_the_joint_and_say_what_to_do() -> None:
    (finding,) = found(DEFECTS['velocity_scale'][0](sound()))
    assert finding.joint == NAMES[JOINT]
    assert finding.severity == 'warning'
    assert finding.text == (
        'the velocity of arm_joint5 is 57.3 times the change of its position, as if in degrees '
        'per second; correct the unit in the driver, or set preprocessing.velocity to '
        'differentiated.'
    )


def test_what_matters_most_comes_first() -> None:
    broken = absent('velocity')(constant('effort')(DEFECTS['still'][0](sound())))
    severities = [finding.severity for finding in found(broken)]
    assert severities == sorted(severities, key=['error', 'warning', 'note'].index)
    assert len(set(severities)) == 3
    assert [each.severity for each in serious(found(broken))] == severities[:-1]


def test_a_joint_that_stands_still_hides_nothing_of_the_others() -> None:
    still = moved(sound(), 0, np.ones(sound().n_samples), np.zeros(sound().n_samples))
    assert codes(still) == {'still'}
    assert codes(times('effort', -1.0)(still)) == {'still', 'effort_sign'}


@pytest.mark.parametrize('delay', [-0.08, -0.04, 0.04, 0.08])
def test_delay_of_the_efforts_is_measured(delay: float) -> None:
    explanation = evidence_of(delayed(sound(seconds=60.0), 'effort', delay)).explanation
    assert explanation is not None
    assert explanation.lag_s == pytest.approx(delay, abs=0.015)


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


def test_settings_for_other_joints_are_told() -> None:
    with pytest.raises(ConfigError, match=r'^recording.effort_scale must have one value for each'):
        evidence_of(sound(), RecordingSettings(effort_scale=(1.0,)))


@pytest.mark.parametrize(
    ('names', 'is_found'),
    [
        (('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint', 'wrist_1_joint'), False),
        (('elbow_joint', 'shoulder_lift_joint', 'shoulder_pan_joint', 'wrist_1_joint'), True),
        (('shoulder_lift_joint', 'shoulder_pan_joint'), True),
        (('joint_1', 'joint_2', 'joint_10'), False),
        (('joint_1', 'joint_10', 'joint_2'), True),
        (('torso_lift_joint', 'arm_1_joint', 'arm_2_joint'), False),
        (('left_shoulder', 'left_wrist', 'right_shoulder', 'right_wrist'), False),
        (('FR_hip', 'FR_thigh', 'FR_calf', 'FL_hip'), False),
        (('a', 'b', 'c'), False),
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
    """Freeze an effort where its joint moves most."""

    def stop(samples: JointSamples) -> JointSamples:
        count = round(seconds * RATE) + 1
        position = samples.position[:, JOINT]
        windows = np.lib.stride_tricks.sliding_window_view(position, count)
        start = int(np.argmax(np.ptp(windows[:-1], axis=1)))
        effort = samples.effort[:, JOINT].copy()
        effort[start : start + count] = effort[start]
        return column(samples, 'effort', JOINT, effort)

    return stop


def returning(share: float) -> Break:
    """Let a joint go this share of its way backward."""

    def go(samples: JointSamples) -> JointSamples:
        wave = np.sin(2 * np.pi / 4.0 * samples.t)
        low, high = 0.0, 1.0
        for _ in range(50):
            offset = 0.5 * (low + high)
            dq = offset + wave
            backward = np.maximum(-dq, 0.0).sum() / np.abs(dq).sum()
            low, high = (offset, high) if backward > share else (low, offset)
        dq = 0.5 * dq
        return moved(samples, JOINT, np.cumsum(dq) / RATE, dq)

    return go


LIMITS: dict[str, tuple[Break, Break]] = {
    'short': (cut_off(20.1), cut_off(19.9)),
    'velocity_delay': (
        lambda samples: delayed(samples, 'velocity', 0.008),
        lambda samples: delayed(samples, 'velocity', 0.012),
    ),
    'velocity_scale': (times('velocity', 1.2), times('velocity', 1.3)),
    'frozen': (stopped(0.9), stopped(1.1)),
    'one_way': (returning(0.115), returning(0.085)),
}


@pytest.mark.parametrize('code', LIMITS)
def test_limits_are_those_of_the_documentation(code: str) -> None:
    inside, beyond = LIMITS[code]
    assert code not in codes(inside(sound()))
    assert code in codes(beyond(sound()))
