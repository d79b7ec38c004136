"""What `train` keeps, without ROS."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
import errno
import os
from pathlib import Path
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from lip_id_ros.acquisition.job import pass_on, receive
from lip_id_ros.acquisition.recorder import _claimed, Gaps, Recorder
from lip_id_ros.errors import LipIdError
from lip_id_ros.recording import Bag, JointSamples, read_sources
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.settings import RecordingSettings

NAMES = ['a', 'b']


def message(
    stamp_s: float,
    position: Sequence[float],
    velocity: Sequence[float] = (),
    effort: Sequence[float] = (),
) -> JointMessage:
    return JointMessage(round(stamp_s * 1e9), NAMES, position, velocity, effort)


def started(joints: Sequence[str] = (), max_rows: int = 1000) -> Recorder:
    recorder = Recorder(joints, max_rows=max_rows)
    recorder.recording = True
    return recorder


def filled(n_rows: int) -> Recorder:
    recorder = started()
    for row in range(n_rows):
        recorder.add(message(100.0 + 0.5 * row, [row, -row], [1.0, 2.0], [3.0, 4.0]))
    return recorder


def assert_same(first: JointSamples, second: JointSamples) -> None:
    assert first.joint_names == second.joint_names
    np.testing.assert_allclose(first.start_s + first.t, second.start_s + second.t, atol=1e-9)
    np.testing.assert_array_equal(first.position, second.position)
    np.testing.assert_array_equal(first.velocity, second.velocity)
    np.testing.assert_array_equal(first.effort, second.effort)


def test_the_end_of_a_disturbed_motion_is_kept_and_left_out_of_fits() -> None:
    recorder = filled(10)  # half a second apart
    recorder.end_disturbed()
    recorder.add(message(105.0, [1.0, 1.0], [1.0, 2.0], [3.0, 4.0]))  # no more recorded
    recorder.recording = True
    for stamp in (106.0, 106.5):
        recorder.add(message(stamp, [1.0, 1.0], [1.0, 2.0], [3.0, 4.0]))
    (samples,) = recorder.samples('joint_states')
    np.testing.assert_allclose(
        samples.start_s + samples.t, [*(100.0 + 0.5 * np.arange(7)), 106.0, 106.5]
    )
    assert len(recorder.tracks('joint_states')[0].t) == 12
    recorder.clear()
    recorder.add(message(104.0, [1.0, 1.0], [1.0, 2.0], [3.0, 4.0]))
    recorder.add(message(104.5, [1.0, 1.0], [1.0, 2.0], [3.0, 4.0]))
    assert recorder.samples('joint_states')[0].n_samples == 2


def test_a_recording_may_be_disturbed_from_its_start() -> None:
    recorder = filled(2)
    recorder.end_disturbed()
    assert recorder.samples('joint_states') == []
    recorder.recording = True
    recorder.add(message(101.0, [1.0, 1.0], [1.0, 2.0], [3.0, 4.0]))
    (samples,) = recorder.samples('joint_states')
    assert (samples.start_s, samples.t.tolist()) == (101.0, [0.0])


def test_nothing_is_kept_while_not_recording() -> None:
    recorder = filled(2)
    recorder.recording = False
    recorder.add(message(200.0, [0.0, 0.0]))
    recorder.add(message(200.0, []))
    assert recorder.status() == {
        'recording': False,
        'received': 2,
        'rows': 2,
        'rows_saved': 0,
        'full': False,
        'disturbed': 0,
        'joint_names': NAMES,
        'other_joints': [],
        'gaps': 0,
        'longest_gap_s': 0.0,
        'rejected': {},
    }


def test_another_robot_on_the_topic_is_no_alarm_beside_this_one() -> None:
    recorder = started(NAMES)
    foreign = message(1.0, [0.0])._replace(names=['finger'])
    recorder.add(foreign)
    assert recorder.n_alarming == 1
    recorder.add(message(2.0, [0.0, 0.0]))
    recorder.add(foreign)
    assert (recorder.n_rejected, recorder.n_alarming) == (2, 0)


def test_memory_is_bounded_and_what_is_left_out_is_counted() -> None:
    recorder = started(max_rows=2)
    for row in range(5):
        recorder.add(message(1.0 + row, [0.0, 0.0]))
    assert len(recorder) == 2
    assert recorder.n_rejected == 3
    assert recorder.is_full
    assert recorder.summary == (
        'recording, 2 samples kept, no more fit under max_rows: call save_dataset, then clear, '
        '3 messages rejected, mostly for: buffer full'
    )


def test_a_recording_of_other_joints_names_them() -> None:
    recorder = Recorder(['x', 'y'], max_rows=2)
    assert recorder.why_empty('/states') == (
        'no samples of /states are kept; call record and move the arm, or name recordings with '
        'bags.'
    )
    recorder.recording = True
    recorder.add(message(1.0, [0.0, 0.0]))
    assert recorder.status()['other_joints'] == NAMES
    assert recorder.why_empty('/states') == (
        'no samples of /states are kept, 1 messages rejected, mostly for: only foreign joints; '
        'choose recording.joints among a, b.'
    )


def test_unsaved_samples_are_kept_in_a_bag_that_reads_back(tmp_path: Path) -> None:
    recorder = filled(20)
    path = tmp_path / 'unsaved.mcap'
    kept = recorder.keep_unsaved(str(path), '/arm/joint_states')
    assert kept == [path]
    (read,) = read_sources([path], RecordingSettings())
    assert_same(read, recorder.samples('')[0])
    assert read.topic == '/arm/joint_states'


def test_a_kept_bag_has_the_stamps_that_came_to_the_nanosecond(tmp_path: Path) -> None:
    """As seconds, stamps of today are up to 119 ns off, and those 100 ns apart were one."""
    recorder = started()
    start = 1_795_285_693_174_866_896
    stamps = [start, start + 1, start + 101, start + 1_000_000_003, start - 7, start - 5, start]
    for stamp in stamps:
        recorder.add(JointMessage(stamp, NAMES, [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]))
    assert recorder.n_rejected == 0
    found = []
    for path in recorder.keep_unsaved(str(tmp_path / 'unsaved.mcap'), 't'):
        with Bag(path) as bag:
            headers = [recorded.header.stamp for _, recorded in bag.messages('t')]
        found += [each.sec * 10**9 + each.nanosec for each in headers]
    assert found == stamps


def test_a_kept_bag_has_the_joints_that_are_recorded_alone(tmp_path: Path) -> None:
    recorder = started(NAMES)
    for row in range(9):
        values = [float(row), 0.5, -float(row)]
        recorder.add(JointMessage(1000 + row, ['b', 'finger', 'a'], values, values, values))
    (path,) = recorder.keep_unsaved(str(tmp_path / 'unsaved.mcap'), 't')
    with Bag(path) as bag:
        kept = [each for _, each in bag.messages('t')]
    assert {tuple(each.name) for each in kept} == {('a', 'b')}
    assert [list(each.position) for each in kept] == [[-row, row] for row in range(9)]


def test_an_earlier_bag_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / 'unsaved.mcap'
    path.write_text('precious')
    assert filled(3).keep_unsaved(str(path), 't') == [tmp_path / 'unsaved_1.mcap']
    assert path.read_text() == 'precious'


def test_recorders_that_keep_at_the_same_time_keep_all(tmp_path: Path) -> None:
    path, meeting = str(tmp_path / 'unsaved.mcap'), threading.Barrier(2, timeout=60.0)

    def keep(n_rows: int) -> list[Path]:
        recorder = filled(n_rows)
        meeting.wait()
        return recorder.keep_unsaved(path, 't')

    with ThreadPoolExecutor() as pool:
        for _ in range(10):
            kept = list(pool.map(keep, (3, 5)))
            for (bag,), n_rows in zip(kept, (3, 5), strict=True):
                with Bag(bag) as opened:
                    assert len(list(opened.messages('t'))) == n_rows


def test_what_a_full_disk_takes_is_kept_and_only_the_rest_called_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = filled(5)
    for row in range(4):
        recorder.add(message(10.0 + row, [row, row]))
    monkeypatch.setattr('lip_id_ros.acquisition.recorder._claimed', full_after(1))
    with pytest.raises(LipIdError) as raised:
        recorder.keep_unsaved(str(tmp_path / 'unsaved.mcap'), 't')
    path = tmp_path / 'unsaved.mcap'
    assert str(raised.value) == (
        f'4 unsaved samples are lost: {path} cannot be written (No space left on device); free '
        'that disk, or change unsaved_path, before the next recording. The others are in '
        f'{path}.'
    )
    with Bag(tmp_path / 'unsaved.mcap') as bag:
        assert len(list(bag.messages('t'))) == 5


def full_after(n_files: int) -> Callable[[Path], Path]:
    """Return what finds names for so many files, then a full disk."""
    find, left = _claimed, iter(range(n_files))

    def claimed(path: Path) -> Path:
        if next(left, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return find(path)

    return claimed


@pytest.mark.parametrize('length', [1, 300])
def test_the_room_that_is_asked_for_suffices_for_names_of_any_length(
    length: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder, path = started(), tmp_path / 'unsaved.mcap'
    names = [f'{joint}'.rjust(length, 'x') for joint in range(5)]
    for row in range(500):
        values = [float(row)] * 5
        recorder.add(JointMessage(1000 + row, names, values, values, values))
    recorder.keep_unsaved(str(path), '/joint_states')
    size = path.stat().st_size - 4096  # the index and the description of the type
    monkeypatch.setattr('shutil.disk_usage', lambda folder: SimpleNamespace(free=size))
    assert recorder.endangered(str(path))


def test_each_section_is_kept_in_a_bag_of_its_own(tmp_path: Path) -> None:
    recorder = filled(5)
    for row in range(4):
        recorder.add(message(10.0 + row, [row, row]))
    path = tmp_path / 'unsaved.mcap'
    kept = recorder.keep_unsaved(str(path), 't')
    assert kept == [path, tmp_path / 'unsaved_1.mcap']
    for read, expected in zip(
        read_sources(kept, RecordingSettings()), recorder.samples('t'), strict=True
    ):
        assert_same(read, expected)


def test_saved_samples_are_not_kept_again(tmp_path: Path) -> None:
    recorder = filled(3)
    recorder.saving(recorder.samples('t'))()
    assert recorder.status()['rows_saved'] == 3
    assert recorder.keep_unsaved(str(tmp_path / 'unsaved.mcap'), 't') == []
    recorder.clear()
    assert recorder.keep_unsaved(str(tmp_path / 'unsaved.mcap'), 't') == []
    assert list(tmp_path.iterdir()) == []


def test_samples_recorded_after_a_clear_are_not_taken_for_saved(tmp_path: Path) -> None:
    recorder = filled(3)
    saved = recorder.saving(recorder.samples('t'))
    recorder.clear()
    recorder.add(message(1.0, [0.0, 0.0]))
    saved()
    assert recorder.keep_unsaved(str(tmp_path / 'unsaved.mcap'), 't') != []


def test_samples_handed_over_arrive_unchanged(tmp_path: Path) -> None:
    recorder = filled(4)
    recorder.add(message(1.0, []))
    for row in range(3):
        recorder.add(message(1.0 + row, [0.0, 0.0]))
    sections = recorder.samples('/joint_states')
    pass_on(tmp_path, sections)
    arrived = receive(tmp_path)
    for one, other in zip(sections, arrived, strict=True):
        assert_same(one, other)
    assert (arrived[0].source, arrived[0].topic) == ('recording', '/joint_states')
    assert [section.counts for section in arrived] == [{'position empty': 1}, {}]


def test_a_long_gap_hides_no_shorter_one_after_it() -> None:
    gaps, usual = Gaps(), 20_000_000
    for step in [*[usual] * 50, 100 * usual, *[usual] * 3, 10 * usual, usual]:
        gaps.add(step)
    assert gaps.count == 2
    assert gaps.longest_s == pytest.approx(2.0)


def test_gaps_in_stamps_are_counted() -> None:
    recorder = started()

    def add(*stamps: float) -> None:
        for stamp in stamps:
            recorder.add(message(stamp, [0.0, 0.0]))

    add(*np.arange(100.0, 101.0, 0.01), 101.05)  # a short step is bridged
    assert 'gaps' not in recorder.summary
    add(*np.arange(104.05, 105.0, 0.01))
    assert (recorder.gaps.count, recorder.status()['longest_gap_s']) == (1, 3.0)
    add(4000.0)  # may be wrong
    assert recorder.gaps.count == 1
    add(4000.01, 4000.02)
    assert 'gaps in stamps: 2 up to 3.9e+03 s' in recorder.summary
    add(*np.arange(50.0, 50.1, 0.01))  # a clock that went back
    recorder.recording = False
    add(60.0)
    recorder.recording = True
    before = len(recorder)
    add(70.0, 70.01, 70.02, 70.03)  # nothing is missing while it was off
    assert len(recorder) == before + 4
    assert recorder.gaps.count == 2
    recorder.recording = False
    add(72.0)
    recorder.recording = True
    add(75.0, 75.01)
    assert recorder.gaps.count == 2
    add(79.0)
    assert recorder.gaps.count == 3
    recorder.clear()
    add(*np.arange(80.0, 84.0, 0.2))  # a slow stream has no gaps
    assert recorder.gaps.count == 0


def test_rows_recorded_during_a_save_are_not_taken_for_saved(tmp_path: Path) -> None:
    recorder = filled(3)
    saved = recorder.saving(recorder.samples('t'))
    recorder.add(message(102.0, [0.0, 0.0], [1.0, 2.0], [3.0, 4.0]))
    saved()
    assert recorder.status()['rows_saved'] == 3
    assert recorder.keep_unsaved(str(tmp_path / 'unsaved.mcap'), 't') != []


def test_messages_without_velocity_are_neither_lost_nor_taken_for_saved(tmp_path: Path) -> None:
    recorder = started()
    for row in range(300):
        velocity = [1.0, 2.0] if row == 7 else []
        recorder.add(message(100.0 + 0.01 * row, [row, -row], velocity))
    recorder.saving(recorder.samples('t'))()
    assert recorder.status()['rows_saved'] == 0
    (path,) = recorder.keep_unsaved(str(tmp_path / 'unsaved.mcap'), 't')
    with Bag(path) as bag:
        kept = [recorded for _, recorded in bag.messages('t')]
    assert len(kept) == 300
    assert [list(each.position) for each in kept] == [[row, -row] for row in range(300)]
    assert [list(each.velocity) for each in kept if len(each.velocity)] == [[1.0, 2.0]]


def test_a_full_disk_is_warned_of_before_it_costs_the_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder, path = filled(20), str(tmp_path / 'unsaved.mcap')
    assert recorder.endangered(path) == ''
    monkeypatch.setattr('shutil.disk_usage', lambda folder: SimpleNamespace(free=3000))
    assert recorder.endangered(path).startswith('20 unsaved samples would be lost, the folder of ')
    recorder.saving(recorder.samples('t'))()
    assert recorder.endangered(path) == ''
