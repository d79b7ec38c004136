"""A kept bag has each message as it came: stamp, frame, order of names, and all its joints."""

from __future__ import annotations

import errno
import os
from pathlib import Path
import tempfile
from types import SimpleNamespace
from typing import Any

import hypothesis as hyp
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.acquisition import originals
from lip_id_ros.acquisition.recorder import Recorder
from lip_id_ros.recording import Bag, spill
from lip_id_ros.recording.collecting import RowStore
from lip_id_ros.recording.joint_messages import JointMessage

ARM = ('a', 'b')
START = 1_795_285_693_174_866_896


@st.composite
def messages(draw: st.DrawFn) -> JointMessage:
    names = draw(st.permutations([*ARM, *draw(st.lists(st.sampled_from('xyzé'), unique=True))]))
    n = len(names)
    numbers = st.lists(st.floats(-1e6, 1e6), min_size=n, max_size=n)
    unknown = st.lists(st.sampled_from([np.nan, np.inf, -np.inf]), min_size=n, max_size=n)
    velocity, effort = (draw(numbers | st.just([]) | unknown) for _ in range(2))
    stamp = START + draw(st.integers(0, 10**10))
    frame = draw(st.sampled_from(['', 'base', 'wörld']) | st.text(max_size=9))
    return JointMessage(stamp, names, draw(numbers), velocity, effort, frame)


def recorded(stream: list[JointMessage]) -> tuple[Recorder, list[JointMessage]]:
    recorder = Recorder(ARM, max_rows=10_000)
    recorder.recording = True
    taken = [message for message in stream if recorder.add(message) is None]
    return recorder, taken


def kept(recorder: Recorder, folder: str | Path) -> list[JointMessage]:
    found: list[JointMessage] = []
    for path in recorder.keep_unsaved(str(Path(folder) / 'kept.mcap'), '/joint_states'):
        with Bag(path) as bag:
            found += [as_message(each) for _, each in bag.messages('/joint_states')]
    return found


def as_message(each: Any) -> JointMessage:
    stamp = each.header.stamp
    at = stamp.sec * 10**9 + stamp.nanosec
    arrays = each.position, each.velocity, each.effort
    return JointMessage(at, each.name, *arrays, each.header.frame_id)


def assert_same(found: list[JointMessage], expected: list[JointMessage]) -> None:
    assert len(found) == len(expected)
    for one, other in zip(found, expected, strict=True):
        assert (one.stamp_ns, one.frame_id) == (other.stamp_ns, other.frame_id)
        assert list(one.names) == list(other.names)
        for came, was in zip(one[2:5], other[2:5], strict=True):
            np.testing.assert_array_equal(came, was)


@pytest.mark.parametrize('large_bytes', [spill.LARGE_BYTES, 0])
@hyp.settings(max_examples=40)
@hyp.given(st.lists(messages(), max_size=12))
def test_a_bag_has_each_message_as_it_came(large_bytes: int, stream: list[JointMessage]) -> None:
    stream.sort(key=lambda message: message.stamp_ns)
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as folder:
        patch.setattr(spill, 'LARGE_BYTES', large_bytes)
        recorder, taken = recorded(stream)
        assert_same(kept(recorder, folder), taken)


def driver(row: int, frame: str, start: int = START) -> JointMessage:
    values = [float(row), -float(row), 0.5]
    names = ['finger', 'b', 'a'] if row % 2 else ['a', 'b', 'finger']
    return JointMessage(start + row * 10**6, names, values, values, values, frame)


def test_a_clock_that_goes_back_mixes_no_sections(tmp_path: Path) -> None:
    """The first messages of the second section wait until it is believed."""
    first, second = ([driver(row, f'{start}', start) for row in range(9)] for start in (START, 1))
    recorder, _ = recorded([*first, *second])
    assert_same(kept(recorder, tmp_path), [*first, *second])


def test_an_endless_variety_of_frames_takes_no_memory(tmp_path: Path) -> None:
    stream = [driver(row, f'frame {row}') for row in range(3000)]
    stream += [driver(row, f'{row}' * 20_000) for row in range(3000, 3009)]
    recorder, taken = recorded(stream)
    assert recorder._originals is not None
    known = recorder._originals._known
    assert len(known) <= originals._MOST_KNOWN
    assert max(len(layout.frame_id) for layout in known) < 20
    assert taken == stream
    assert_same(kept(recorder, tmp_path), stream)


def test_memory_is_flat_once_other_joints_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spill, 'LARGE_BYTES', 100_000)
    recorder, _ = recorded([driver(row, 'base') for row in range(9_000)])
    assert recorder._originals is not None
    for store in (recorder._originals._numbers, recorder._originals._places):
        assert store._file is not None
        assert store._array.nbytes < 100_000


def full(store: RowStore, rows: Any) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def no_memory(store: RowStore, rows: Any) -> None:
    raise MemoryError


@pytest.mark.parametrize('extend', [full, no_memory, None])
def test_without_room_for_others_the_arm_is_kept_and_it_is_told(
    extend: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder, _ = recorded([driver(row, 'base') for row in range(50)])
    assert recorder.endangered(str(tmp_path / 'kept.mcap')) == ''
    if extend:
        monkeypatch.setattr(RowStore, 'extend', extend)
    else:
        monkeypatch.setattr(originals, 'MOST_BYTES', 1000)
    later = [driver(row, 'base') for row in range(50, 100)]
    assert [recorder.add(each) for each in later] == [None] * 50
    assert recorder.endangered(str(tmp_path / 'kept.mcap')) == (
        'frames and other joints are not kept: no room for them'
    )
    found = kept(recorder, tmp_path)
    assert [list(each.names) for each in found] == [list(ARM)] * 100
    assert [list(each.position) for each in found] == [
        [0.5, -float(row)] if row % 2 else [float(row), -float(row)] for row in range(100)
    ]
    recorder.clear()
    assert recorder.as_they_came


def test_the_room_that_is_asked_for_suffices_for_other_joints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [*ARM, *(f'{joint}'.rjust(100, 'x') for joint in range(30))]
    values = [0.5] * len(names)
    frame = 'frame'.rjust(200, 'x')
    stream = [
        JointMessage(START + row, names, values, values, values, frame) for row in range(500)
    ]
    recorder, _ = recorded(stream)
    path = tmp_path / 'kept.mcap'
    recorder.keep_unsaved(str(path), '/joint_states')
    size = path.stat().st_size - 4096  # the index and the description of the type
    monkeypatch.setattr('shutil.disk_usage', lambda folder: SimpleNamespace(free=size))
    assert 'unsaved samples would be lost' in recorder.endangered(str(path))
