"""A sound recording broken in every way that a check finds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from health.recordings import (
    column,
    delayed,
    moved,
    NAMES,
    RATE,
    rows,
    sound,
)
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.timing import arrange

Break = Callable[[JointSamples], JointSamples]


JOINT = 4
SIDES = tuple(f'{side}_arm_{name}' for side in ('left', 'right') for name in ('a', 'b', 'c'))


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


def set_back(samples: JointSamples) -> JointSamples:
    stamps = np.arange(100) * 10**7
    return replace(samples, notes=arrange(np.concatenate([stamps, stamps + 5 * 10**8])).notes)


def repeating(samples: JointSamples) -> JointSamples:
    source = np.arange(samples.n_samples)
    source[::20] = np.maximum(source[::20] - 1, 0)
    return replace(rows(samples, source), t=samples.t)


def holding(samples: JointSamples) -> JointSamples:
    return replace(samples, effort=samples.effort[4 * (np.arange(samples.n_samples) // 4)])


def with_outliers(samples: JointSamples) -> JointSamples:
    effort = samples.effort[:, JOINT].copy()
    effort[[700, 1500, 2300]] = 40.0 * np.ptp(effort)
    return column(samples, 'effort', JOINT, effort)


def in_degrees(samples: JointSamples) -> JointSamples:
    factor = 180.0 / np.pi
    return moved(
        samples, JOINT, factor * samples.position[:, JOINT], factor * samples.velocity[:, JOINT]
    )


def all_in_degrees(samples: JointSamples) -> JointSamples:
    """Record in degrees another motion, which stays within five turns of what should be rad."""
    small, factor = sound(reach=0.12), 180.0 / np.pi
    return replace(small, position=factor * small.position, velocity=factor * small.velocity)


def random_velocity(samples: JointSamples) -> JointSamples:
    noise = np.random.default_rng(1).standard_normal(samples.n_samples)
    return column(samples, 'velocity', JOINT, noise)


def clipped(samples: JointSamples) -> JointSamples:
    effort = samples.effort[:, JOINT]
    return column(samples, 'effort', JOINT, np.clip(effort, *np.percentile(effort, [10, 90])))


def unrelated(samples: JointSamples) -> JointSamples:
    noise = np.random.default_rng(1).standard_normal(samples.n_samples)
    return column(samples, 'effort', JOINT, noise)


def stopped(samples: JointSamples) -> JointSamples:
    """Hold a posture by brakes for five seconds, with the drives off."""
    source = np.concatenate([np.arange(1500), np.full(500, 1500), np.arange(1500, 3000)])
    is_held = np.diff(source, prepend=-1) == 0
    noise = 1e-6 * np.random.default_rng(0).standard_normal((source.size, samples.n_joints))
    return replace(
        samples,
        t=np.arange(source.size) / RATE,
        position=samples.position[source] + noise,
        velocity=np.where(is_held[:, None], noise, samples.velocity[source]),
        effort=np.where(is_held[:, None], 0.0, samples.effort[source]),
    )


def frozen(signal: str) -> Break:
    def stop(samples: JointSamples) -> JointSamples:
        values = getattr(samples, signal)[:, JOINT].copy()
        values[1000:1300] = values[1000]
        return column(samples, signal, JOINT, values)

    return stop


def jumping(samples: JointSamples) -> JointSamples:
    first = np.arange(samples.n_samples) < 2000
    return column(
        samples, 'position', JOINT, samples.position[:, JOINT] - np.where(first, 0.3, 0.0)
    )


def alternating(samples: JointSamples) -> JointSamples:
    """Mix in every third sample from a publisher of another posture."""
    other = np.arange(samples.n_samples)[:, None] % 3 == 1
    return replace(samples, position=np.where(other, 0.0, samples.position))


def held_alone(samples: JointSamples) -> JointSamples:
    effort = samples.effort[10 * (np.arange(samples.n_samples) // 10), JOINT]
    return column(samples, 'effort', JOINT, effort)


def exchanged(samples: JointSamples) -> JointSamples:
    return replace(samples, effort=samples.effort[:, [0, 1, 2, 3, 5, 4, 6]])


def resting(samples: JointSamples) -> JointSamples:
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
    'clock_back': (set_back, set()),
    'dropped': (lambda samples: replace(samples, counts={'joint missing': 100}), set()),
    'stale': (repeating, set()),
    'held': (holding, set()),
    'outliers': (with_outliers, set()),
    'position_unit': (in_degrees, set()),
    'position_degrees': (all_in_degrees, set()),
    'velocity_missing': (absent('velocity'), set()),
    'velocity_constant': (constant('velocity'), set()),
    'velocity_sign': (times('velocity', -1.0), set()),
    'velocity_scale': (times('velocity', 180 / np.pi), set()),
    'velocity_unlike': (random_velocity, set()),
    'velocity_delay': (lambda samples: delayed(samples, 'velocity', 0.03), set()),
    'effort_missing': (absent('effort'), set()),
    'effort_constant': (constant('effort'), set()),
    'effort_zero': (stopped, set()),
    'effort_clipped': (clipped, set()),
    'effort_sign': (times('effort', -1.0), set()),
    'effort_unrelated': (unrelated, set()),
    'effort_unsigned': (
        lambda samples: replace(samples, effort=np.abs(samples.effort)),
        {'effort_unrelated', 'effort_sign'},
    ),
    'effort_copied': (
        lambda samples: column(samples, 'effort', JOINT, -0.3 * samples.effort[:, 2]),
        {'effort_unrelated', 'effort_sign'},
    ),
    'effort_exchanged': (exchanged, {'effort_sign'}),
    'effort_held': (held_alone, {'effort_clipped'}),
    'effort_delay': (lambda samples: delayed(samples, 'effort', 0.06), set()),
    'effort_small': (lambda samples: replace(samples, effort=0.03 * samples.effort), set()),
    'effort_huge': (times('effort', 1e4), set()),
    'alternating': (alternating, {'position_jump', 'velocity_unlike', 'velocity_scale'}),
    'coarse': (rounded('effort', 0.5), set()),
    'frozen': (frozen('effort'), set()),
    'position_frozen': (frozen('position'), {'position_jump'}),
    'position_jump': (jumping, set()),
    'still': (small_motion(1e-6), set()),
    'little_range': (small_motion(0.05), {'gentle', 'slow'}),
    'slow': (slowed, {'gentle'}),
    'gentle': (gentle, set()),
    'one_way': (one_way, set()),
    'together': (together, set()),
    'resting': (resting, set()),
    'joint_order': (renamed(tuple(sorted(f'arm_joint{n}' for n in range(5, 12)))), set()),
    'two_arms': (renamed(('torso', *SIDES)), set()),
    'gripper_joint': (renamed((*NAMES[:-1], 'panda_finger_joint1')), set()),
}

SAID = {
    'short': 'lasts 15 s',
    'low_rate': 'come at 10 Hz',
    'gaps': '7 gaps, the longest of 0.22 s',
    'dropped': '100 of 4100 messages',
    'stale': '5 % of the samples repeat',
    'held': 'each effort is held over 4 samples',
    'frozen': 'for 2.99 s from 10 s on',
    'position_jump': 'jump 1 times, first that of arm_joint5 at 20 s',
    'position_frozen': 'for 2.99 s from 10 s on',
    'velocity_delay': 'arm_joint1 is 30 ms behind its position',
    'effort_zero': 'for 4.99 s of 35 s, longest for 4.99 s from 15.01 s on',
    'effort_clipped': 'in 10 % of the samples',
    'effort_exchanged': 'of arm_joint5 and arm_joint6 seem',
    'effort_copied': 'of arm_joint5 is that of arm_joint3',
    'effort_held': 'of arm_joint5 is held over 10 samples',
    'effort_delay': 'about 59 ms behind the motion',
    'coarse': 'in steps of 0.5,',
    'position_unit': 'arm_joint5 moves by 200 rad',
    'little_range': 'over 0.17 rad only',
    'slow': 'of arm_joint5 is 0.022 rad/s',
    'gentle': 'below 0.39 rad/s^2 in 99 %',
    'together': 'arm_joint5 moves in step with arm_joint2',
    'resting': 'rests in 55 % of the recording',
    'joint_order': 'arm_joint11 comes before arm_joint5',
    'two_arms': '3 joints of a left arm',
}
"""What findings must say of the defects of `sound()`, whose sizes are known."""
