"""Joint samples from bags of every kind, and what is wrong with those that have none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import shutil
import sqlite3
from typing import Any

import numpy as np
import pytest
from recording.bag_files import (
    JOINT_STATE,
    moving,
    State,
    STEP_NS,
    TEXT,
    write_file,
    write_folder,
    write_raw,
    write_ros1,
)

from lip_id_ros.errors import SourceError
from lip_id_ros.recording import JointSamples, read_bag, Reason
from lip_id_ros.settings import RecordingSettings

EVERY_KIND = ('folder.db3', 'folder.mcap', 'bare.db3', 'bare.mcap', 'ros1.bag')


def write(path: Path, states: list[State]) -> Path:
    if path.suffix == '.bag':
        return write_ros1(path, states)
    if path.stem == 'bare':
        return write_file(path.parent / 'bare', states, path.suffix)
    return write_folder(path.with_suffix(''), states, path.suffix)


def read(path: Path, **settings: object) -> JointSamples:
    return read_bag(path, RecordingSettings(**settings))  # type: ignore[arg-type]


@pytest.mark.parametrize('kind', EVERY_KIND)
def test_every_kind_of_bag_gives_the_same_samples(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path / kind, moving(20))
    samples = read_bag(path)
    k = np.arange(20.0)
    np.testing.assert_allclose(samples.t, 0.01 * k)
    np.testing.assert_allclose(samples.position, np.column_stack([0.01 * k, -0.02 * k]))
    np.testing.assert_allclose(samples.effort, np.column_stack([3 + k, 4 - k]))
    assert samples.joint_names == ('shoulder', 'elbow')
    assert (samples.source, samples.topic, samples.counts) == (str(path), '/joint_states', {})


def test_folder_without_metadata_is_read_in_the_order_of_numbers(tmp_path: Path) -> None:
    states = moving(30)
    folder = tmp_path / 'bag'
    folder.mkdir()
    for number in (2, 10, 9):
        part = [states.pop(0) for _ in range(10)] if number != 10 else states[10:]
        shutil.move(
            write_file(tmp_path / f'part{number}', part, '.db3'), folder / f'bag_{number}.db3'
        )
    assert read_bag(folder).n_samples == 30


@pytest.mark.parametrize(
    'statements',
    [
        ['DROP TABLE schema', 'DROP TABLE message_definitions'],
        ["UPDATE message_definitions SET encoded_message_definition='?! = {'"],
        [
            "UPDATE topics SET type='odd/msg/Odd' WHERE name='/others'",
            "INSERT INTO message_definitions VALUES (9, 'odd/msg/Odd', 'ros2msg', '?! = {', '')",
        ],
    ],
    ids=['none', 'unreadable', 'unreadable of another topic'],
)
def test_known_definitions_are_not_needed(tmp_path: Path, statements: list[str]) -> None:
    path = write_file(tmp_path / 'bag', [*moving(5), *moving(5, topic='/others')], '.db3')
    with sqlite3.connect(path) as database:
        for statement in statements:
            database.execute(statement)
    assert read_bag(path).n_samples == 5


def test_joints_are_chosen_and_ordered_by_the_settings(tmp_path: Path) -> None:
    path = write_folder(tmp_path / 'bag', moving(3))
    samples = read(path, joints=('elbow',))
    assert samples.joint_names == ('elbow',)
    np.testing.assert_allclose(samples.position, [[0.0], [-0.02], [-0.04]])


def test_messages_of_other_publishers_are_counted(tmp_path: Path) -> None:
    states = moving(10)
    states.insert(3, State(3, [1.0], [1.0], [1.0], ['finger']))
    states.insert(5, State(4 * STEP_NS + 5, [1.0], [1.0], [1.0], ['elbow']))
    samples = read_bag(write_folder(tmp_path / 'bag', states))
    assert samples.n_samples == 10
    assert samples.counts == {Reason.FOREIGN_JOINTS: 1, Reason.MISSING_JOINT: 1}


def test_first_message_of_the_wrong_publisher_is_reported(tmp_path: Path) -> None:
    states = [State(0, [1.0], [1.0], [1.0], ['finger']), *moving(10)[1:]]
    path = write_folder(tmp_path / 'bag', states)
    sentence = (
        r'^most messages of /joint_states in .*bag lack joints of the first one, finger '
        r'\(9 only foreign joints\); name the joints to use with recording.joints.$'
    )
    with pytest.raises(SourceError, match=sentence):
        read_bag(path)
    assert read(path, joints=('shoulder', 'elbow')).n_samples == 9


def test_header_stamps_are_used_where_they_advance(tmp_path: Path) -> None:
    first_ns = 1_700_000_000_000_000_000
    states = [
        State(first_ns + k * STEP_NS, [0.1 * k, 0.0], receive_ns=10**15 + k // 5)
        for k in range(20)
    ]
    samples = read_bag(write_folder(tmp_path / 'bag', states))
    assert samples.n_samples == 20
    assert samples.start_s == pytest.approx(1e-9 * first_ns)
    np.testing.assert_allclose(np.diff(samples.t), 0.01, atol=1e-6)


@pytest.mark.parametrize('stamp', [lambda k: 0, lambda k: 77, lambda k: (20 - k) * 1000])
def test_receive_stamps_are_used_where_headers_do_not_advance(
    tmp_path: Path, stamp: Callable[[int], int]
) -> None:
    states = [State(stamp(k), [0.1 * k, 0.0], receive_ns=k * STEP_NS) for k in range(20)]
    samples = read_bag(write_folder(tmp_path / 'bag', states, '.mcap'))
    np.testing.assert_allclose(samples.t, 0.01 * np.arange(20))


def test_topic_is_the_only_one_or_joint_states_or_the_one_named(tmp_path: Path) -> None:
    left, right = moving(3, topic='/left'), moving(4, topic='/right')
    both = write_folder(tmp_path / 'both', [*left, *right])
    assert read_bag(write_folder(tmp_path / 'one', left)).topic == '/left'
    assert read(both, topic='/right').n_samples == 4
    assert read(both, topic='right').n_samples == 4
    with_default = write_folder(tmp_path / 'default', [*left, *moving(5)])
    assert read_bag(with_default).topic == '/joint_states'


def test_several_topics_need_a_choice(tmp_path: Path) -> None:
    states = [*moving(3, topic='/left'), *moving(3, topic='/right')]
    path = write_folder(tmp_path / 'bag', states)
    sentence = (
        rf'^.*bag has several topics with joint samples: /left \({JOINT_STATE}, 3 messages\), '
        rf'/right \({JOINT_STATE}, 3 messages\); choose one, or several separated by commas, with '
        r'recording.topic.$'
    )
    with pytest.raises(SourceError, match=sentence):
        read_bag(path)
    sentence = (
        r"^recording.topic must be a topic of .*bag with joint samples, not '/middle'; it has "
        rf'/left \({JOINT_STATE}, 3 messages\), /right \({JOINT_STATE}, 3 messages\).$'
    )
    with pytest.raises(SourceError, match=sentence):
        read(path, topic='/middle')


def test_bag_without_joint_states_names_what_it_has(tmp_path: Path) -> None:
    path = write_raw(tmp_path / 'bag', '/chatter', TEXT, [b'\0\1\0\0\1\0\0\0\0'], '.mcap')
    sentence = (
        rf'^.*bag must have a topic of {JOINT_STATE} or control_msgs/msg/JointTrajectoryController'
        rf'State, but has /chatter \({TEXT}, 1 messages\); record joint_states.$'
    )
    with pytest.raises(SourceError, match=sentence):
        read_bag(path)


@pytest.mark.parametrize('suffix', ['.db3', '.mcap'])
def test_bag_without_anything(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(SourceError, match=r'must have a topic of .*, but has no topics; record'):
        read_bag(write_folder(tmp_path / 'bag', [], suffix))


@pytest.mark.parametrize('suffix', ['.db3', '.mcap'])
def test_topic_without_messages(tmp_path: Path, suffix: str) -> None:
    path = write_folder(tmp_path / 'bag', [], suffix, empty_topics=['/joint_states'])
    sentence = r'^/joint_states in .*bag must hold messages, but is empty; record while the arm'
    with pytest.raises(SourceError, match=sentence):
        read_bag(path)


def test_missing_joint_is_reported(tmp_path: Path) -> None:
    path = write_folder(tmp_path / 'bag', moving(3))
    sentence = (
        r'^joint wrist expected in /joint_states in .*bag, which has shoulder, elbow; correct the '
        r'names, or give a recording of this arm.$'
    )
    with pytest.raises(SourceError, match=sentence):
        read(path, joints=('shoulder', 'wrist'))
    with pytest.raises(SourceError, match=r'shoulder, elbow; did you mean shoulder, elbow\?$'):
        read(path, joints=('shuolder', 'ebow'))


def test_nan_everywhere_is_reported(tmp_path: Path) -> None:
    path = write_folder(tmp_path / 'bag', moving(3, effort=(float('nan'), 1.0)))
    sentence = r'can be used \(3 value not finite; some values of shoulder are not finite\);'
    with pytest.raises(SourceError, match=sentence):
        read_bag(path)
    assert read(path, joints=('elbow',)).n_samples == 3


@pytest.mark.parametrize('signal', ['velocity', 'effort'])
def test_a_signal_of_nothing_but_nan_was_not_recorded(tmp_path: Path, signal: str) -> None:
    """As ros2_control publishes where no joint has such an interface."""
    nothing: dict[str, Any] = {signal: (float('nan'), float('nan'))}
    path = write_folder(tmp_path / 'bag', moving(30, **nothing))
    samples = read_bag(path)
    assert samples.n_samples == 30
    assert (samples.has_velocity, samples.has_effort) == (signal == 'effort', signal == 'velocity')
    states = [*moving(10, **nothing), *moving(30)[10:]]
    samples = read_bag(write_folder(tmp_path / 'late', states))
    assert samples.counts == {f'{signal} empty where others have it': 10}


@pytest.mark.parametrize('name', ['bag.txt', 'bag', 'bag.npz', 'bag.MCAP.zip'])
def test_other_files_are_refused_by_name(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b'something')
    with pytest.raises(SourceError, match=rf'{name} must be a rosbag2 folder, a .mcap, .db3, .ba'):
        read_bag(tmp_path / name)


def test_folder_without_a_bag(tmp_path: Path) -> None:
    (tmp_path / 'notes.txt').write_text('nothing')
    sentence = r'must hold .mcap, .db3, .bag files of one bag, but has no such file; give the fo'
    with pytest.raises(SourceError, match=sentence):
        read_bag(tmp_path)
    folder = write_folder(tmp_path / 'bag', moving(3))
    next(folder.glob('*.db3')).unlink()
    with pytest.raises(
        SourceError, match=r'must hold .* but has none of bag.db3, which metadata.yaml names; giv'
    ):
        read_bag(folder)


def test_a_folder_of_recordings_names_them(tmp_path: Path) -> None:
    for name in ('monday', 'friday'):
        write_folder(tmp_path / name, moving(3))
    (tmp_path / 'log.csv').write_text('t,q_a,tau_a\n')
    sentence = r'but has recordings: friday/, monday/, log.csv; give one or several of these by'
    with pytest.raises(SourceError, match=sentence):
        read_bag(tmp_path)


@pytest.mark.parametrize('name', ['bag.mcap', 'bag.db3', 'bag.bag'])
def test_empty_file(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    with pytest.raises(SourceError, match=rf'{name} is an empty file; record it again.$'):
        read_bag(tmp_path / name)


@pytest.mark.parametrize('name', ['bag.mcap', 'bag.db3', 'bag.bag'])
@pytest.mark.parametrize(
    'content', [b'x', b'not a bag at all' * 100, bytes(5000)], ids=['byte', 'text', 'zeros']
)
def test_foreign_file(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(SourceError, match=rf'{name} cannot be read as .* \(.*\); record it'):
        read_bag(tmp_path / name)


def test_progress_ends_at_the_total(tmp_path: Path) -> None:
    calls: list[tuple[str, int, int]] = []
    path = write_folder(tmp_path / 'bag', moving(1500))
    read_bag(path, progress=lambda *call: calls.append(call))
    assert calls == [('reading bag', done, 1500) for done in (0, 1024, 1500, 1500)]


def test_real_panda_bag(shared_data: Path) -> None:
    """No metadata.yaml, no message definitions, stamps from exactly zero."""
    samples = read_bag(shared_data / 'unisa_ros2_bags' / 'panda')
    assert (samples.n_samples, samples.n_joints, samples.counts) == (727, 7, {})
    assert samples.start_s == 0.0
    assert samples.t[-1] == pytest.approx(24.2, abs=0.01)


def test_real_ur10_bag(shared_data: Path) -> None:
    """First stamp is 1 ns, then exact 8 ms; velocity fits the differentiated position."""
    samples = read_bag(shared_data / 'unisa_ros2_bags' / 'ur10')
    assert (samples.n_samples, samples.n_joints, samples.counts) == (3441, 6, {})
    assert samples.start_s == 1e-9
    slopes = np.gradient(samples.position, samples.t, axis=0)
    for joint in range(6):
        assert np.corrcoef(slopes[:, joint], samples.velocity[:, joint])[0, 1] > 0.999


def test_real_bag_of_a_plan_has_no_samples(shared_data: Path) -> None:
    sentence = (
        r'but has /joint_space_trajectory \(trajectory_msgs/msg/JointTrajectory, 1 messages\); rec'
    )
    with pytest.raises(SourceError, match=sentence):
        read_bag(shared_data / 'unisa_ros2_bags' / 'ur10_validation')
