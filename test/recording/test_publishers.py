"""Several publishers, topics and bags; controller states; any order and loss of messages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import sqlite3
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from recording.bag_files import (
    CONTROLLER,
    moving,
    of_effort_alone,
    of_one_joint,
    State,
    STEP_NS,
    write_controller_states,
    write_defined,
    write_folder,
    write_mcap,
)

from lip_id_ros.errors import SourceError
from lip_id_ros.recording import JointSamples, read_bag, read_sources, Reason
from lip_id_ros.settings import RecordingSettings

NAMES = ('shoulder', 'elbow')
BOTH = RecordingSettings(joints=NAMES)


def assert_same(samples: JointSamples, expected: JointSamples) -> None:
    np.testing.assert_array_equal(samples.t, expected.t)
    for name in ('position', 'velocity', 'effort'):
        np.testing.assert_array_equal(getattr(samples, name), getattr(expected, name))


@pytest.fixture
def clean(tmp_path: Path) -> JointSamples:
    return read_bag(write_folder(tmp_path / 'clean', moving(50)), BOTH)


def test_publishers_of_some_joints_each_are_merged(tmp_path: Path, clean: JointSamples) -> None:
    states = [of_one_joint(state, joint) for state in moving(50) for joint in (0, 1)]
    samples = read_bag(write_folder(tmp_path / 'bag', states), BOTH)
    assert_same(samples, clean)
    assert samples.counts == {}
    assert samples.notes == ('joints of 2 publishers were merged in time',)


def test_of_publishers_of_the_same_joints_one_with_efforts_is_taken(
    tmp_path: Path, clean: JointSamples
) -> None:
    """Rather than one that has more messages, or velocities."""
    torques = [replace(state, velocity=()) for state in moving(50)]
    more: dict[str, Any] = {'names': (*NAMES, 'gripper'), 'position': (0.1, 0.2, 0.3)}
    seen = [
        replace(
            state, **more, velocity=(0.1, 0.2, 0.3), effort=(), stamp_ns=state.stamp_ns + shift
        )
        for state in moving(50)
        for shift in (3_000_000, 6_000_000)
    ]
    sent = sorted([*torques, *seen], key=lambda state: state.stamp_ns)
    samples = read_bag(write_folder(tmp_path / 'bag', sent), BOTH)
    np.testing.assert_array_equal(samples.effort, clean.effort)
    assert samples.counts == {Reason.OTHER_PUBLISHER: 100}


def test_topics_of_some_joints_each_are_merged(tmp_path: Path, clean: JointSamples) -> None:
    states = [
        of_one_joint(state, joint, topic=topic)
        for state in moving(50)
        for joint, topic in enumerate(('/left', '/right'))
    ]
    path = write_folder(tmp_path / 'bag', states)
    samples = read_bag(path, replace(BOTH, topic='/right, left'))
    assert_same(samples, clean)
    assert samples.topic == '/right, /left'
    assert samples.joint_names == NAMES


def test_bags_of_some_joints_each_are_merged(tmp_path: Path, clean: JointSamples) -> None:
    paths = [
        write_folder(tmp_path / name, [of_one_joint(state, joint) for state in moving(50)])
        for joint, name in enumerate(('left', 'right'))
    ]
    whole = write_folder(tmp_path / 'whole', moving(7))
    first, second = read_sources([paths[0], whole, paths[1]], BOTH)
    assert first.n_samples == 7
    assert_same(second, clean)
    assert second.source == f'{paths[0]}, {paths[1]}'


def test_other_rates_are_interpolated_and_nothing_crosses_a_gap(tmp_path: Path) -> None:
    """The slower publisher gives the times; values change linearly, so they must be exact."""
    slow = [of_one_joint(state, 0) for state in moving(400)[::4]]
    fast = [
        of_one_joint(state, 1, stamp_ns=state.stamp_ns + 3_000_000)
        for k, state in enumerate(moving(400))
        if not 100 <= k < 200
    ]
    samples = read_bag(write_folder(tmp_path / 'bag', [*slow, *fast]), BOTH)
    k = np.array([k for k in range(4, 400, 4) if not 100 <= k <= 200])
    np.testing.assert_allclose(samples.t, 0.01 * (k - 4), atol=1e-12)
    np.testing.assert_allclose(samples.position[:, 0], 0.01 * k)
    np.testing.assert_allclose(samples.position[:, 1], -0.02 * (k - 0.3))
    assert samples.counts == {Reason.OTHER_JOINTS_AWAY: 100 - k.size}


@pytest.mark.parametrize('topic', ['/joint_states', '/currents'])
@pytest.mark.parametrize('names', [NAMES, ('elbow', 'wrist', 'shoulder')])
def test_efforts_that_come_alone_are_joined(
    tmp_path: Path, clean: JointSamples, topic: str, names: Sequence[str]
) -> None:
    """On the topic of the joint states or another, their joints in any order."""
    sent = []
    for state in moving(50):
        by_name = {**dict(zip(NAMES, state.effort, strict=True)), 'wrist': 9.0}
        efforts = of_effort_alone(state, effort=[by_name[name] for name in names], names=names)
        sent += [replace(efforts, topic=topic), replace(state, effort=())]
    path = write_folder(tmp_path / 'bag', sent)
    samples = read_bag(path, replace(BOTH, topic=','.join({'/joint_states': '', topic: ''})))
    assert_same(samples, clean)
    assert samples.has_effort
    assert samples.counts == {}
    assert samples.notes == ('efforts came in messages of their own and were joined in time',)


@pytest.mark.parametrize(
    ('slow_hz', 'ripple_hz', 'most'), [(1.0, 101.0, 0.1), (1.0, 333.0, 0.1), (5.0, 0.0, 1e-3)]
)
def test_what_is_slow_in_efforts_stays_and_what_is_fast_is_not_taken_for_it(
    tmp_path: Path, slow_hz: float, ripple_hz: float, most: float
) -> None:
    """
    At 1 kHz beside states at 50 Hz.

    A ripple of 101 Hz would look like one of 1 Hz, and a mean over a step of the states would take
    1.8 % of 5 Hz.

    """
    states = [replace(state, effort=()) for state in moving(200)[::2]]
    efforts = []
    for k in range(2000):
        value = [sum(np.sin(2e-3 * np.pi * hz * k) for hz in (slow_hz, ripple_hz)), 1.0]
        stamp = states[0].stamp_ns + k * STEP_NS // 10
        state = replace(moving(1)[0], effort=value, stamp_ns=stamp)
        efforts.append(of_effort_alone(state, topic='/currents'))
    path = write_folder(tmp_path / 'bag', [*states, *efforts])
    samples = read_bag(path, RecordingSettings(topic='/joint_states, /currents'))
    slow = np.sin(2.0 * np.pi * slow_hz * samples.t)
    np.testing.assert_allclose(samples.effort[2:-2, 0], slow[2:-2], atol=most)
    np.testing.assert_allclose(samples.effort[:, 1], 1.0)


def test_efforts_at_another_rate_are_interpolated(tmp_path: Path) -> None:
    """Named joints are not needed, and the slower topic gives the times."""
    efforts = [of_effort_alone(state, topic='/currents') for state in moving(100)[::5]]
    late = [replace(each, stamp_ns=each.stamp_ns + 2_000_000) for each in efforts]
    states = [replace(state, effort=()) for state in moving(100)]
    path = write_folder(tmp_path / 'bag', [*late, *states])
    samples = read_bag(path, RecordingSettings(topic='/joint_states, /currents'))
    k = np.arange(0, 100, 5)
    assert samples.joint_names == NAMES
    np.testing.assert_allclose(samples.t, 0.01 * k, atol=1e-12)
    np.testing.assert_allclose(samples.position[:, 0], 0.01 * (k + 0.2))
    np.testing.assert_array_equal(samples.effort[:, 0], 3.0 + k)


def test_efforts_that_come_alone_replace_no_others(tmp_path: Path, clean: JointSamples) -> None:
    sent = [
        each for state in moving(50) for each in (state, of_effort_alone(state, effort=(7, 8)))
    ]
    samples = read_bag(write_folder(tmp_path / 'bag', sent), BOTH)
    assert_same(samples, clean)
    assert samples.counts == {Reason.NO_POSITION: 50}


def test_efforts_of_some_joints_are_none(tmp_path: Path) -> None:
    sent = [replace(state, effort=()) for state in moving(50)]
    sent += [of_effort_alone(state, names=NAMES[:1], effort=(7,)) for state in moving(50)]
    samples = read_bag(write_folder(tmp_path / 'bag', sent), BOTH)
    assert not samples.has_effort
    assert samples.n_samples == samples.counts[Reason.NO_POSITION] == 50


def test_joint_states_are_preferred_to_controller_states(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / 'bag', moving(5, topic='/arm'), '.mcap', ['/empty'])
    controller = write_controller_states(tmp_path / 'controller', 'new', [{}] * 3)
    next(controller.glob('*.mcap')).rename(folder / 'bag_1.mcap')
    assert read_bag(folder).topic == '/arm'


MEASURED = {'positions': [1.0, 2.0], 'velocities': [3.0, 4.0]}
COMMAND = {'positions': [9.0, 9.0], 'effort': [5.0, 6.0]}


@pytest.mark.parametrize(
    ('form', 'point', 'effort'),
    [
        ('new', {'feedback': MEASURED, 'output': COMMAND}, [5.0, 6.0]),
        ('new', {'feedback': {**MEASURED, 'effort': [7.0, 8.0]}, 'output': COMMAND}, [7.0, 8.0]),
        ('new', {'feedback': MEASURED, 'reference': COMMAND}, None),
        ('old', {'actual': {**MEASURED, 'effort': [7.0, 8.0]}, 'desired': COMMAND}, [7.0, 8.0]),
        ('old', {'actual': MEASURED, 'desired': COMMAND}, None),
    ],
)
def test_controller_states(
    tmp_path: Path,
    form: str,
    point: dict[str, dict[str, Sequence[float]]],
    effort: list[float] | None,
) -> None:
    samples = read_bag(write_controller_states(tmp_path / 'bag', form, [point] * 4))
    np.testing.assert_allclose(samples.t, [0.0, 0.01, 0.02, 0.03])
    assert samples.joint_names == ('a', 'b')
    np.testing.assert_array_equal(samples.position, [[1.0, 2.0]] * 4)
    np.testing.assert_array_equal(samples.velocity, [[3.0, 4.0]] * 4)
    assert samples.has_effort == (effort is not None)
    if effort:
        np.testing.assert_array_equal(samples.effort, [effort] * 4)


@pytest.mark.parametrize('form', ['newest', 'new', 'old'])
def test_controller_states_without_definition(tmp_path: Path, form: str) -> None:
    """Up to Humble sqlite3 files had none; the length of a message decides which form it has."""
    points: Any = [{'feedback': MEASURED, 'actual': MEASURED, 'output': COMMAND}] * 4
    folder = write_controller_states(tmp_path / 'bag', form, points, '.db3')
    with sqlite3.connect(next(folder.glob('*.db3'))) as database:
        database.execute('DELETE FROM message_definitions')
    samples = read_bag(folder)
    np.testing.assert_array_equal(samples.position, [[1.0, 2.0]] * 4)
    assert samples.has_effort == (form != 'old')
    assert samples.counts == {}


def test_short_controller_states_are_counted(tmp_path: Path) -> None:
    points: list[dict[str, Any]] = [{'feedback': MEASURED}, {'feedback': {'positions': [1.0]}}, {}]
    samples = read_bag(write_controller_states(tmp_path / 'bag', 'new', points))
    assert (samples.n_samples, samples.counts) == (
        1,
        {Reason.POSITION_LENGTH: 1, Reason.NO_POSITION: 1},
    )


def test_clock_can_be_chosen(tmp_path: Path) -> None:
    states = [replace(state, receive_ns=2 * state.stamp_ns) for state in moving(5)]
    path = write_folder(tmp_path / 'bag', states)
    for clock, step in (('auto', 0.01), ('header', 0.01), ('receive', 0.02)):
        samples = read_bag(path, RecordingSettings(clock=clock))
        np.testing.assert_allclose(np.diff(samples.t), step)
        assert samples.clock == ('receive' if clock == 'receive' else 'header')


STRAYS = [
    State(STEP_NS + 1, names=('finger', 'thumb')),
    State(STEP_NS + 1, position=(1.0,)),
    State(STEP_NS + 1, effort=(float('nan'), 0.0)),
    State(STEP_NS + 1, velocity=(1e12, 0.0)),
    State(STEP_NS + 1, names=()),
    State(-1, receive_ns=1),
]
WRONG_STAMPS = [State(2 * 10**18, position=(7.0, 7.0)), State(0, position=(7.0, 7.0))]
FIRST_NS = 10**18
COUNT = 60
CLEAN = [replace(each, stamp_ns=each.stamp_ns + FIRST_NS) for each in moving(COUNT)]


@settings(max_examples=40)
@given(
    lost=st.sets(st.integers(0, COUNT - 1), max_size=40),
    shifts=st.lists(st.integers(-8, 8), min_size=COUNT, max_size=COUNT),
    strays=st.lists(st.tuples(st.integers(0, COUNT), st.sampled_from(STRAYS)), max_size=8),
    wrong=st.lists(st.tuples(st.integers(0, COUNT), st.sampled_from(WRONG_STAMPS)), max_size=2),
    turned=st.sets(st.integers(0, COUNT - 1)),
    again=st.sets(st.integers(0, COUNT - 1), max_size=10),
)
def test_any_interleaving_order_and_loss_gives_the_clean_samples_but_those_counted(
    tmp_path_factory: pytest.TempPathFactory,
    lost: set[int],
    shifts: list[int],
    strays: list[tuple[int, State]],
    wrong: list[tuple[int, State]],
    turned: set[int],
    again: set[int],
) -> None:
    kept = sorted(set(range(COUNT)) - lost, key=lambda k: k + 1.01 * shifts[k])
    sent = [_turned(CLEAN[k]) if k in turned else CLEAN[k] for k in kept]
    sent += [CLEAN[k] for k in again - lost]
    for place, stray in strays + wrong:
        sent.insert(place, stray)
    path = tmp_path_factory.mktemp('any') / 'bag.mcap'
    samples = read_bag(write_mcap(path, sent, chunk_size=700), replace(BOTH, clock='header'))
    k = np.sort(kept)
    np.testing.assert_allclose(samples.t, 0.01 * (k - k[0]), atol=1e-9)
    for name in ('position', 'velocity', 'effort'):
        expected = [getattr(CLEAN[row], name) for row in k]
        np.testing.assert_array_equal(getattr(samples, name), expected)
    counts = Counter(samples.counts)
    assert counts.pop(Reason.REPEATED_STAMP, 0) == len(again - lost)
    assert counts.total() == len(strays) + len(wrong)


def _turned(state: State) -> State:
    parts = ('names', 'position', 'velocity', 'effort')
    values: dict[str, Any] = {name: getattr(state, name)[::-1] for name in parts}
    return replace(state, **values)


def test_controller_states_with_other_fields_are_unreadable(tmp_path: Path) -> None:
    text = 'std_msgs/Header header\nstring[] joint_names\nfloat64[] feedback'
    path = write_defined(
        tmp_path / 'bag', CONTROLLER, text, joint_names=['a'], feedback=np.ones(1)
    )
    with pytest.raises(SourceError, match=r'can be used \(3 message unreadable\)'):
        read_bag(path)
