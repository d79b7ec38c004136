"""Findings in real recordings, and that they are true."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health import evidence_of, examine
from lip_id_ros.recording import JointSamples, read_bag
from lip_id_ros.recording.reading import read_log
from lip_id_ros.settings import RecordingSettings

ARM = RecordingSettings(joint_types=('prismatic',) + ('revolute',) * 7)
MOTOR_CONSTANTS = (1.0, 13.6, 13.6, -8.7, -8.7, -20.6, -20.6, -20.6)


def found(
    samples: JointSamples, settings: RecordingSettings | None = None
) -> dict[str, list[str]]:
    kinds: dict[str, list[str]] = {}
    for finding in examine(evidence_of(samples, settings)):
        kinds.setdefault(finding.code, []).append(finding.joint)
    return kinds


def table(path: Path, header: int = 1) -> Array:
    return np.loadtxt(path, delimiter=',', skiprows=header)


def samples_of(t: Array, q: Array, dq: Array, tau: Array, stem: str = 'joint') -> JointSamples:
    keep = np.concatenate([[True], np.diff(t) > 0])
    names = tuple(f'{stem}_{number}' for number in range(q.shape[1]))
    return JointSamples(t[keep] - t[0], q[keep], dq[keep], tau[keep], names)


def tiago(shared_data: Path) -> JointSamples:
    """The torso (joint 0) and the seven joints of the arm."""
    folder = shared_data / 'tiago_figaroh'
    parts = [table(folder / f'tiago_{name}.csv') for name in ('position', 'velocity', 'effort')]
    q, dq, tau = (part[:, 1:] for part in parts)
    return samples_of(parts[0][:, 0], q, dq, tau)


def test_ur10_is_sound_but_gentle_in_the_shoulder(shared_data: Path) -> None:
    samples = read_bag(shared_data / 'unisa_ros2_bags' / 'ur10')
    assert found(samples) == {'gentle': ['shoulder_lift_joint']}


def test_panda_moves_two_pairs_of_joints_in_step(shared_data: Path) -> None:
    """Its published trajectory does; and its driver repeats a state now and then."""
    samples = read_bag(shared_data / 'unisa_ros2_bags' / 'panda')
    assert found(samples) == {'together': ['fer_joint3', 'fer_joint7'], 'stale': ['']}


def test_currents_of_tiago_and_their_signs(shared_data: Path) -> None:
    """The motor constants that come with the data are negative for joints 3 to 7."""
    raw = found(tiago(shared_data), ARM)
    assert raw['effort_small'] == ['']
    assert {'joint_3', 'joint_4'} <= set(raw['effort_sign']) <= {f'joint_{n}' for n in range(3, 8)}
    assert raw['coarse'] == ['joint_5', 'joint_6', 'joint_7']  # 40 to 46 distinct values

    scaled = found(tiago(shared_data), replace(ARM, effort_scale=MOTOR_CONSTANTS))
    assert not {'effort_small', 'effort_sign'} & set(scaled)


def test_kuka_without_velocities_is_too_short(shared_data: Path) -> None:
    columns = table(shared_data / 'kuka_lbr_med7' / 'measurements.csv')
    q, tau = columns[:, :7], columns[:, 7:14]
    samples = samples_of(np.arange(len(q)) / 100.0, q, np.full_like(q, np.nan), tau)
    assert set(found(samples)) == {'short', 'velocity_missing', 'together'}


def test_an_effort_of_a_drive_without_power_is_not_reversed(shared_data: Path) -> None:
    """In the log only motor 1 is powered; the effort of joint 2 comes in 0.2 of its deviations."""
    samples = read_log(shared_data / 'dfki_double_pendulum' / 'C1_0629_144115.csv')
    assert set(found(samples)) == {'short', 'coarse', 'effort_small'}


def test_legs_of_go2_have_gaps_and_bursts(shared_data: Path) -> None:
    kinds = []
    for number in (1, 4):
        path = shared_data / 'unitree_go2_csv' / f'test_{number}_state_history.csv'
        columns = table(path, header=0)
        q, dq, tau = (columns[:, first : first + 12] for first in (1, 13, 25))
        t = 1e-9 * (columns[:, 0] - columns[0, 0])
        kinds.append(found(samples_of(t, q, dq, tau)))
    assert set(kinds[0]) == {'short', 'together'}
    assert set(kinds[1]) == {'gaps', 'jitter', 'position_jump'}  # 0.5 rad within 5 ms
