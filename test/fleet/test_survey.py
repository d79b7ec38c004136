"""The survey of a recording, and which recordings are of one arm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fleet.fleets import arm_of, friction_of, recording
import numpy as np
from numpy.testing import assert_allclose
from recording.bag_files import PLUGINS, ROS2
from rosbags import rosbag2

from lip_id_ros.dataset import Dataset
from lip_id_ros.fleet.survey import (
    joint_order,
    mean_temperature,
    merged,
    MOST_RESERVOIR,
    reservoir,
    reservoir_data,
    sorted_of_one_arm,
    survey,
    survey_of,
    TEMPERATURE,
)
from lip_id_ros.identification.folds import motion_of_samples_s
from lip_id_ros.settings import Config, PreprocessingSettings, RecordingSettings
from lip_id_ros.simulation.datasets import write_bag

ARM = arm_of()
FRICTION = friction_of(ARM, np.random.default_rng(0), 0.1)


def data(seed: int = 1, count: int = 400) -> Dataset:
    return recording(ARM, FRICTION, seed, count)


def write_temperatures(folder: Path, values: list[float]) -> None:
    with rosbag2.Writer(folder, version=9, storage_plugin=PLUGINS['.mcap']) as writer:
        connection = writer.add_connection('/motor', TEMPERATURE, typestore=ROS2)
        kinds = ROS2.types
        header = kinds['std_msgs/msg/Header'](kinds['builtin_interfaces/msg/Time'](0, 0), '')
        for k, value in enumerate(values):
            message = kinds[TEMPERATURE](header, value, 0.0)
            writer.write(connection, k, ROS2.serialize_cdr(message, TEMPERATURE))


def test_gaps_are_no_part_of_a_recording() -> None:
    motion = data()
    late = np.arange(400) >= 100
    apart = replace(motion, t=motion.t + 60.0 * late, segment=late.astype(np.int64))
    assert_allclose(survey_of(apart, 'name', 'group').seconds, motion.t[-1] - 1.0 / 50.0)


def test_a_recording_that_repeats_itself_has_the_motion_of_once() -> None:
    """Few of its samples are hardly ever at the same places."""
    t = np.arange(0.0, 300.0, 0.02)
    angle = 2.0 * np.pi / 2.0 * t[:, None] + np.arange(7.0)
    states = np.sin(angle), np.pi * np.cos(angle), -(np.pi**2) * np.sin(angle)
    motion = Dataset.from_arrays(*states, np.sin(angle), t=t)
    other = replace(motion, q=motion.q + 1e-4)
    some = [survey_of(each, '', '') for each in (motion, other)]
    few = merged(some, motion.joint_names)
    assert_allclose(motion_of_samples_s(few, [each.motion_s for each in some]), [600.0, 2.0], 0.1)


def test_a_bag_is_surveyed_with_rate_start_and_health(tmp_path: Path) -> None:
    motion = data()
    write_bag(tmp_path / 'bag', motion, start=1000.0)
    names = Config(recording=RecordingSettings(joints=motion.joint_names))
    found = survey(tmp_path / 'bag', 'cell 3', 'robot 7', names)
    assert (found.name, found.group, found.joint_names) == (
        'cell 3',
        'robot 7',
        motion.joint_names,
    )
    assert_allclose(found.rate_hz, 50.0, rtol=1e-3)
    assert found.start_s == 1000.0
    assert 6.5 < found.seconds < 8.0
    assert any('short' in line for line in found.health)
    assert np.isnan(found.temperature)
    assert_allclose(found.high[0], found.q.max(axis=0), atol=0.2)


def test_the_key_of_a_bag_does_not_depend_on_the_preprocessing(tmp_path: Path) -> None:
    """Its rounding differs between processors, and keys order the recordings."""
    keys = set()
    for number, cutoff in ((0, 4.0), (1, 3.9)):
        config = Config(preprocessing=PreprocessingSettings(cutoff_hz=cutoff))
        write_bag(tmp_path / f'{number}', data(), start=1000.0)
        keys.add(survey(tmp_path / f'{number}', '', '', config).key)
    write_bag(tmp_path / 'other', data(seed=2), start=1000.0)
    assert len(keys) == 1
    assert survey(tmp_path / 'other', '', '', Config()).key not in keys


def test_temperatures_of_a_bag_are_averaged(tmp_path: Path) -> None:
    write_temperatures(tmp_path / 'bag', [30.0, 34.0, np.nan])
    assert mean_temperature(tmp_path / 'bag') == 32.0


def test_a_reservoir_covers_the_motion_and_is_even_in_time() -> None:
    motion = data(count=5000)
    rows = reservoir(motion)
    assert MOST_RESERVOIR // 2 <= rows.size <= MOST_RESERVOIR
    assert np.diff(rows).max() <= 2 * motion.n_samples // MOST_RESERVOIR + 1
    some = motion.select(rows)
    for name in ('q', 'dq', 'ddq'):
        assert_allclose(
            getattr(some, name).max(axis=0), getattr(motion, name).max(axis=0), rtol=0.05
        )


def test_a_reservoir_has_the_signs_that_friction_is_fitted_with() -> None:
    motion = data()
    signed = replace(motion, low_passed_sign=np.tanh(motion.dq + motion.ddq))
    some = reservoir_data(survey_of(signed, 'cell', 'robot'), motion.joint_names[::-1])
    expected = signed.select(np.isin(signed.t, some.t)).low_passed_sign
    assert expected is not None
    np.testing.assert_array_equal(some.low_passed_sign, expected[:, ::-1])
    without = reservoir_data(survey_of(motion, 'cell', 'robot'), motion.joint_names)
    assert without.low_passed_sign is None


def test_the_order_of_surveys_plays_no_role() -> None:
    surveys = [survey_of(data(seed), f'{seed}', 'robot') for seed in range(5)]
    names = joint_order(surveys)
    both = [
        merged([some[k] for k in sorted_of_one_arm(some)[0]], names)
        for some in (surveys, surveys[::-1])
    ]
    np.testing.assert_array_equal(both[0].tau, both[1].tau)
    assert len(np.unique(both[0].recording)) == 5


def test_other_joints_and_copies_are_left_out() -> None:
    surveys = [survey_of(data(seed), f'{seed}', 'robot') for seed in range(3)]
    other = survey_of(replace(data(7), joint_names=('left', 'right')), 'other', 'robot')
    kept, left_out = sorted_of_one_arm([*surveys, other, replace(surveys[0], name='zopy')])
    assert sorted(kept) == [0, 1, 2]
    assert left_out[3].startswith('has joints left, right of types revolute, revolute and not')
    assert left_out[4] == 'is a copy of 0'


def test_keys_follow_every_value_of_a_recording(tmp_path: Path) -> None:
    motion = data()
    changed = [
        replace(motion, ddq=-motion.ddq),
        replace(motion, dq=0.9 * motion.dq),
        replace(motion, t=2.0 * motion.t),
        replace(motion, segment=(np.arange(motion.n_samples) > 200).astype(int)),
        replace(motion, joint_types=('revolute', 'prismatic')),
        replace(motion, gravity_compensated=True),
        replace(motion, provenance={'sources': [{'preprocessing': {'cutoff_hz': 3.0}}]}),
    ]
    keys = {survey_of(each, '', '').key for each in (motion, *changed)}
    assert len(keys) == 1 + len(changed)
    assert survey_of(motion.with_joints(motion.joint_names[::-1]), '', '').key in keys
    bags = set()
    for number, each in enumerate((motion, changed[2])):
        write_bag(tmp_path / f'{number}', each, start=1000.0)
        bags.add(survey(tmp_path / f'{number}', '', '', Config()).key)
    assert len(bags) == 2
