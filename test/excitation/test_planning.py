"""From settings to a motion and its files."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

from excitation.cases import ARM
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
import yaml

import lip_id_ros as lip
from lip_id_ros.excitation.motion_tables import motion_lines, motion_table
from lip_id_ros.excitation.report import motion_figure
from lip_id_ros.excitation.trajectory_file import is_motion, TOPIC, Trajectory, writer_for
from lip_id_ros.recording.bag_writer import JointStateTrack, JointTrajectoryTrack, write_mcap

QUICK = lip.ExcitationConfig(
    lip.MotionSettings(duration_s=4.0, rate_hz=50.0, size=1.0),
    lip.SpaceSettings(radius_m=0.03),
    lip.SearchSettings(draws=4),
)


@pytest.fixture(scope='module')
def found() -> lip.ExcitingMotion:
    return lip.design_motion(QUICK, ARM)


def test_the_best_of_so_many_draws_is_taken_and_compared_with_the_median(
    found: lip.ExcitingMotion,
) -> None:
    drawn = found.design.drawn
    assert len(drawn) == 4
    assert found.design.criterion == pytest.approx(drawn.min(), abs=0.05)  # held more finely
    assert found.gain == pytest.approx(np.exp(found.design.criterion - np.median(drawn)))
    (line,) = (each for each in motion_lines(found) if each.startswith('Best of 4 random'))
    assert f'is {found.gain:.2f} of that after the median draw' in line
    more = lip.design_motion(replace(QUICK, search=lip.SearchSettings(draws=20)), ARM)
    np.testing.assert_allclose(more.design.drawn[:4], drawn)
    assert more.design.criterion == pytest.approx(more.design.drawn.min(), abs=0.05)


def test_how_far_and_how_fast_it_goes_is_said(found: lip.ExcitingMotion) -> None:
    q, dq = found.motion.sample(np.linspace(0.0, 4.0, 4001))[:2]
    reach = 0.2 + q[:, 2]  # of the slide's end, beyond which is half the thickness
    lowest = np.minimum(0.3 - np.sin(q[:, 1]) * reach, 0.3).min() - 0.03
    far = np.hypot(np.cos(q[:, 1]) * reach, 0.3 - np.sin(q[:, 1]) * reach).max() + 0.03
    assert found.extremes is not None
    (low, height), (most, distance) = found.extremes
    assert (low, most) == ('c', 'c')
    assert height == pytest.approx(lowest, abs=2e-3)
    assert distance == pytest.approx(far, abs=2e-3)
    fastest = np.abs(dq).max(axis=0)
    unit = ('rad/s', 'rad/s', 'm/s')[int(fastest.argmax())]
    line, note = found.sentences
    assert f'Lowest point: c, {lowest:.2f} m above the base plane. Farthest point: c, ' in line
    name = found.joint_names[int(fastest.argmax())]
    assert f'Fastest joint: {name}, {fastest.max():.3g} {unit}.' in line
    assert note.startswith('No shapes are at hand of a, b, c: space.radius_m, 0.03 m, is taken')


def test_largest_values_are_shown_beside_their_limits(found: lip.ExcitingMotion) -> None:
    t = np.linspace(0.0, 4.0, 4001)
    rows = motion_table(found).rows
    for order, limits in enumerate(found.limits.derivatives, start=1):
        largest = np.abs(found.motion.derivative(t, order)).max(axis=0)
        for row, value, limit in zip(rows, largest, limits, strict=True):
            peak, bound = row[3 + order].split(' of ')
            assert float(peak) == pytest.approx(value, rel=0.01)
            assert float(bound) == pytest.approx(limit, rel=0.01)


def test_the_same_seed_gives_the_same_motion(found: lip.ExcitingMotion) -> None:
    again = lip.design_motion(QUICK, ARM)
    np.testing.assert_array_equal(again.motion.coefficients, found.motion.coefficients)
    search = replace(QUICK.search, seed=1)
    other = lip.design_motion(replace(QUICK, search=search), ARM)
    assert np.abs(other.motion.coefficients - found.motion.coefficients).max() > 0.01


def test_joints_and_limits_are_those_of_the_urdf(found: lip.ExcitingMotion) -> None:
    assert found.joint_names == ('turn', 'lift', 'slide')
    assert found.joint_types == ('revolute', 'revolute', 'prismatic')
    np.testing.assert_allclose(found.limits.velocity, 0.9 * np.array([2.0, 1.0, 0.4]))
    low, high = found.position_ends
    assert np.all(low >= found.limits.lower)
    assert np.all(high <= found.limits.upper)


def test_progress_comes_to_its_end() -> None:
    reports: list[tuple[str, int, int]] = []
    lip.design_motion(QUICK, ARM, progress=lambda *report: reports.append(report))
    assert reports == [('design', step, 4) for step in range(1, 5)]


def test_joints_without_a_urdf_need_names_and_limits() -> None:
    with pytest.raises(lip.ConfigError, match=r'motion\.joints must name the joints from base'):
        lip.design_motion(QUICK)
    named = replace(QUICK.motion, joints=('a', 'b'), lower=(-1.0,), upper=(1.0,), velocity=(1.0,))
    found = lip.design_motion(replace(QUICK, motion=named))
    assert found.joint_names == ('a', 'b')
    assert found.extremes is None
    assert found.sentences[1] == (
        'Nobody has checked the floor and self-collision: no URDF says where the links are.'
    )


def test_joints_that_are_no_arm_of_the_urdf_are_refused() -> None:
    motion = replace(QUICK.motion, joints=('lift', 'turn'))
    with pytest.raises(lip.DataError, match="joint 'turn' was expected to be carried by"):
        lip.design_motion(replace(QUICK, motion=motion), ARM)
    motion = replace(QUICK.motion, joints=('lift', 'elbow'))
    with pytest.raises(lip.DataError, match="joint 'elbow' of the data is not among the joints"):
        lip.design_motion(replace(QUICK, motion=motion), ARM)


def test_settings_may_be_a_file(tmp_path: Path, found: lip.ExcitingMotion) -> None:
    path = tmp_path / 'excite.yaml'
    path.write_text(
        'motion: {duration_s: 4.0, rate_hz: 50, size: 1}\nspace: {radius_m: 0.03}\n'
        'search: {draws: 4}\n'
    )
    again = lip.design_motion(path, ARM)
    np.testing.assert_array_equal(again.motion.coefficients, found.motion.coefficients)


def test_yaml_is_the_message(tmp_path: Path, found: lip.ExcitingMotion) -> None:
    path = tmp_path / 'motion.yaml'
    found.save(path)
    message = yaml.safe_load(path.read_text())
    assert is_motion(path)
    assert message['joint_names'] == list(found.joint_names)
    check_points(
        found,
        [tuple(point[name] for name in NAMES) for point in message['points']],
        [
            point['time_from_start']['sec'] + 1e-9 * point['time_from_start']['nanosec']
            for point in message['points']
        ],
    )


NAMES = ('positions', 'velocities', 'accelerations')


def check_points(
    found: lip.ExcitingMotion, states: list[tuple[list[float], ...]], times: list[float]
) -> None:
    expected = found.trajectory
    assert len(times) == 201
    np.testing.assert_allclose(times, expected.t, atol=1e-9)
    for values, name in zip(np.array(states).transpose(1, 0, 2), ('q', 'dq', 'ddq'), strict=True):
        np.testing.assert_array_equal(values, getattr(expected, name))


def test_bag_has_the_message(tmp_path: Path, found: lip.ExcitingMotion) -> None:
    path = tmp_path / 'motion.mcap'
    found.save(path)
    assert is_motion(path)
    with AnyReader([path]) as bag:
        ((connection, _, raw),) = bag.messages()
        message: Any = bag.deserialize(raw, connection.msgtype)
    assert connection.topic == '/joint_trajectory'
    assert message.joint_names == list(found.joint_names)
    check_points(
        found,
        [tuple(getattr(point, name) for name in NAMES) for point in message.points],
        [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points],
    )


def test_csv_has_a_column_for_each_signal(tmp_path: Path, found: lip.ExcitingMotion) -> None:
    path = tmp_path / 'motion.csv'
    found.save(path)
    assert is_motion(path)
    header = path.read_text().splitlines()[0].split(',')
    assert header[:5] == ['t', 'q_turn', 'q_lift', 'q_slide', 'dq_turn']
    table = np.loadtxt(path, delimiter=',', skiprows=1)
    np.testing.assert_array_equal(table, np.column_stack(found.trajectory[1:]))


def test_odd_names_are_written_and_known_again(tmp_path: Path) -> None:
    names = ('a,b', '"q"', 'é\U0001f600', 'null')
    states = np.zeros((3, 2, 4))
    for suffix in ('yaml', 'csv'):
        path = tmp_path / f'motion.{suffix}'
        writer_for(str(path))(str(path), Trajectory(names, np.arange(2.0), *states))
        assert is_motion(path)
    message = yaml.safe_load((tmp_path / 'motion.yaml').read_text())
    assert tuple(message['joint_names']) == names
    with open(tmp_path / 'motion.csv', newline='') as file:
        header = next(csv.reader(file))
    assert header[1:5] == [f'q_{name}' for name in names]


def test_a_recording_is_no_motion_that_may_be_replaced(tmp_path: Path) -> None:
    path = tmp_path / 'motion.mcap'
    zero = np.zeros((1, 1))
    planned = JointTrajectoryTrack(TOPIC, ('a',), np.zeros(1), zero, zero, zero)
    write_mcap(path, [planned])
    assert is_motion(path)
    write_mcap(path, [planned, JointStateTrack('/joint_states', ('a',), np.zeros(1), zero)])
    assert not is_motion(path)


def test_a_fast_motion_is_seen_and_written_at_enough_times() -> None:
    motion = lip.MotionSettings(('a',), lower=(-1.0,), upper=(1.0,), velocity=(1.0,))
    motion = replace(motion, duration_s=0.1, jerk=(1e5,), acceleration=(1e3,), rate_hz=250.0)
    settings = lip.ExcitationConfig(motion, search=lip.SearchSettings(draws=2))
    found = lip.design_motion(settings)
    q = found.motion.derivative(found.motion.times(1e6), 0)
    way = np.ptp(q)
    assert np.ptp(found.position_ends) == pytest.approx(way, rel=1e-3)
    positions = motion_figure(found).axes[0].lines[0].get_ydata()
    assert np.ptp(np.asarray(positions)) == pytest.approx(way, rel=1e-3)
    slow = replace(settings, motion=replace(motion, rate_hz=249.0))
    with pytest.raises(
        lip.ConfigError, match=r'motion\.rate_hz must be at least 250 for a motion'
    ):
        lip.design_motion(slow)


def test_other_suffixes_are_refused(found: lip.ExcitingMotion) -> None:
    with pytest.raises(lip.ConfigError, match=r'as \.yaml, \.csv, \.mcap, but m\.txt ends othe'):
        found.save('m.txt')
