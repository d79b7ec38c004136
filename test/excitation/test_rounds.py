"""Motions one after the other, without ROS: their sizes, and what stops one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from excitation.cases import ARM
from excitation.test_next_motion import model
import numpy as np
import pytest

from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.rounds import (
    MotionRequest,
    MotionWatch,
    next_motion,
    NextMotion,
    numbered,
)
from lip_id_ros.excitation.trajectory_file import Trajectory
from lip_id_ros.model import InverseDynamicsModel

NAMES = ('a', 'b')
SETTINGS = """
motion: {joints: [a, b], duration_s: 4.0, lower: [-1.0], upper: [1.0], velocity: [2.0]}
search: {draws: 2}
"""
SETTINGS_OF_THREE = """
motion: {duration_s: 4.0, velocity: [2.0, 2.0, 0.5], torque_limits: [1.0e4]}
space: {radius_m: 0.03}
search: {draws: 2}
"""


def watch(**limits: float) -> MotionWatch:
    """Watch a motion of the first joint from 0 to 1 rad in 1 s."""
    t = np.array([0.0, 1.0])
    still = np.zeros((2, 2))
    planned = Trajectory(NAMES, t, np.array([[0.0, 0.0], [1.0, 0.0]]), still, still)
    tracking, effort = limits.get('tracking', 0.1), limits.get('effort', np.inf)
    return MotionWatch(planned, np.full(2, tracking), np.full(2, effort))


@pytest.mark.parametrize(
    ('q', 'effort', 'limits', 'reason'),
    [
        ((0.55, 0.0), (9.0, 0.0), {}, None),
        ((0.39, 0.0), (0.0, 0.0), {}, 'a is 0.11 away from its plan, beyond 0.1'),
        ((0.5, np.nan), (0.0, 0.0), {}, 'b is nan away'),
        ((0.5, 0.0), (0.0, -2.5), {'effort': 2.0}, 'b has an effort of 2.5, beyond 2'),
        ((0.5, 0.0), (), {'effort': 2.0}, 'have no effort'),
        ((0.5, 0.0), (), {}, None),
    ],
)
def test_what_stops_a_motion(
    q: tuple[float, ...], effort: tuple[float, ...], limits: dict[str, float], reason: str | None
) -> None:
    found = watch(**limits).reason_to_stop((0.5, 0.5), q, effort)
    assert found is None if reason is None else found is not None and reason in found


def test_a_joint_is_on_its_way_if_it_is_at_any_time_it_may_be_at() -> None:
    judged = watch()
    on_its_way = judged.reason_to_stop((0.3, 0.6), (0.21, 0.0), (0.0, 0.0))
    assert on_its_way is None
    assert judged.reason_to_stop((0.3, 0.6), (0.69, 0.0), (0.0, 0.0)) is None
    behind = judged.reason_to_stop((0.3, 0.6), (0.19, 0.0), (0.0, 0.0))
    ahead = judged.reason_to_stop((0.3, 0.6), (0.72, 0.0), (0.0, 0.0))
    assert behind is not None
    assert 'a is 0.11 away' in behind
    assert ahead is not None
    assert 'a is 0.12 away' in ahead


@pytest.mark.parametrize(
    ('ends', 'reason'),
    [
        ((0.0, 1.0), None),
        ((0.3, 0.9), None),
        ((0.3, 0.7), 'a has moved 0.4 of its 1 in the motion'),
        ((), 'a has moved nan of its 1'),
    ],
)
def test_a_joint_that_stood_still_has_not_executed_the_motion(
    ends: tuple[float, ...], reason: str | None
) -> None:
    judged = watch(tracking=1.0)
    for end in ends:
        assert judged.reason_to_stop((0.0, 1.0), (end, 0.0), ()) is None
    found = judged.reason_to_distrust()
    assert found is None if reason is None else found is not None and reason in found


def request(folder: Path, **changes: object) -> MotionRequest:
    settings = folder / 'excite.yaml'
    settings.write_text(SETTINGS)
    given = {
        'config_path': str(settings),
        'description': '',
        'model_path': '',
        'last_size': 0.0,
        'first_size': 0.2,
        'positions': {'b': -0.3, 'a': 0.4, 'gripper': 9.0},
    }
    return MotionRequest(**{**given, **changes})  # type: ignore[arg-type]


def test_the_first_motion_is_small_and_begins_where_the_arm_is(tmp_path: Path) -> None:
    motion, _ = next_motion(request(tmp_path))
    q, dq = motion.trajectory.q, motion.trajectory.dq
    np.testing.assert_allclose(q[[0, -1]], [[0.4, -0.3]] * 2, atol=1e-9)
    assert motion.size == 0.2
    assert 0.1 < np.abs(dq).max() <= 0.4
    assert (q.max(axis=0) <= [0.4 + 0.2 * 0.6, -0.3 + 0.2 * 1.3]).all()
    assert motion.deviation_percent == ()
    (speed, unchecked) = motion.sentences
    assert speed.startswith('Fastest joint: ')
    assert unchecked.startswith('Nobody has checked the floor and self-collision')
    again = NextMotion.from_json(motion.to_json())
    assert again.sentences == motion.sentences
    np.testing.assert_array_equal(again.trajectory.q, q)


def test_a_joint_without_a_position_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match='lacks b; correct'):
        next_motion(request(tmp_path, positions={'a': 0.4}))


def test_motions_are_numbered() -> None:
    assert numbered('/data/motion.yaml', 2) == '/data/motion_2.yaml'


@pytest.mark.parametrize(('last', 'size'), [(0.1, 0.2), (0.2, 0.3), (0.3, 0.3)])
def test_the_floor_holds_in_every_round_which_grows_no_further_than_the_settings_have_it(
    tmp_path: Path, last: float, size: float
) -> None:
    path = str(tmp_path / 'model.npz')
    proven().save(path)
    positions = {'turn': 0.0, 'lift': 0.35, 'slide': 0.3}  # 5 cm above what the floor allows
    after = request(
        tmp_path, model_path=path, description=ARM, positions=positions, last_size=last
    )
    (tmp_path / 'excite.yaml').write_text(SETTINGS_OF_THREE)
    motion, found = next_motion(after)
    assert motion.size == pytest.approx(size)
    q = found.motion.derivative(found.motion.times(1e4), 0)
    lowest = 0.3 - np.sin(q[:, 1]) * (0.2 + q[:, 2]) - 0.03
    assert 0.05 <= lowest.min() < 0.09
    assert f'{lowest.min():.2f} m above the base plane' in motion.sentences[0]


def proven() -> InverseDynamicsModel:
    """Return the model as one that was judged on unseen motion."""
    summary = {
        'unexplained_percent': [1.0] * 3,
        'new_motion_s': 60.0,
        'motion_s': 60.0,
        'held_out': {'nmse_percent': [1.0] * 3, 'new_motion_s': 20.0},
    }
    return replace(model(), summary=summary)


def test_deviations_are_what_was_not_known_before_the_motion(tmp_path: Path) -> None:
    path = str(tmp_path / 'model.npz')
    model().save(path)
    positions = {'turn': 0.0, 'lift': 0.2, 'slide': 0.3}
    after = request(tmp_path, model_path=path, description=ARM, positions=positions)
    (tmp_path / 'excite.yaml').write_text(SETTINGS_OF_THREE)
    motion, found = next_motion(after)
    assert found.learning is not None
    targets = found.learning.targets
    std, tau = model().torque_std(*targets), model().predict(*targets).tau
    shares = np.sqrt(np.mean(std**2, axis=0) / np.mean(tau**2, axis=0))
    np.testing.assert_allclose(motion.deviation_percent, 100.0 * shares, rtol=1e-6)
