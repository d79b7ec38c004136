"""Bags that are written can be read back, by others too, and are whole or absent."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest

from lip_id_ros.recording import bag_writer
from lip_id_ros.recording.bag_writer import JointStateTrack, write_bag_folder, write_mcap


def messages(path: Path) -> list[tuple[str, Any]]:
    with path.open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, decoded) for _, channel, _, decoded in reader.iter_decoded_messages()
        ]


def seconds(message: Any) -> float:
    return float(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)


def test_tracks_are_merged_in_the_order_of_time(tmp_path: Path) -> None:
    first = JointStateTrack('/a', ['x'], np.array([0.0, 2.0]), position=np.array([[1.0], [2.0]]))
    second = JointStateTrack('/b', ['y'], np.array([1.0, 3.0]), effort=np.array([[5.0], [6.0]]))

    write_mcap(tmp_path / 'out.mcap', [first, second])

    found = messages(tmp_path / 'out.mcap')
    assert [topic for topic, _ in found] == ['/a', '/b', '/a', '/b']
    assert [seconds(message) for _, message in found] == [0.0, 1.0, 2.0, 3.0]
    assert [list(message.position) for _, message in found] == [[1.0], [], [2.0], []]
    assert [list(message.effort) for _, message in found] == [[], [5.0], [], [6.0]]
    assert list(found[0][1].name) == ['x']
    assert list(tmp_path.iterdir()) == [tmp_path / 'out.mcap']


def test_a_failure_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    track = JointStateTrack('/a', ['x'], np.array([0.0]))
    (tmp_path / 'out.mcap').write_text('precious')

    def fail(*_: Any) -> None:
        raise OSError('disk full')

    monkeypatch.setattr(bag_writer.RawBag, 'write_message', fail)
    for write in (write_mcap, write_bag_folder):
        with pytest.raises(OSError, match=r'disk full|exists'):
            write(tmp_path / 'out.mcap', [track])
    with pytest.raises(OSError, match='disk full'):
        write_bag_folder(tmp_path / 'bag', [track])

    assert (tmp_path / 'out.mcap').read_text() == 'precious'
    assert list(tmp_path.iterdir()) == [tmp_path / 'out.mcap']


def test_a_bag_says_what_plotting_tools_need(tmp_path: Path) -> None:
    """PlotJuggler and Foxglove decode by profile, schema and encoding, without ROS."""
    write_mcap(tmp_path / 'out.mcap', [JointStateTrack('/a', ['x'], np.array([0.0]))])
    with (tmp_path / 'out.mcap').open('rb') as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert reader.get_header().profile == 'ros2'
    assert summary is not None
    (channel,) = summary.channels.values()
    schema = summary.schemas[channel.schema_id]
    assert (channel.message_encoding, schema.encoding) == ('cdr', 'ros2msg')
    assert schema.name == 'sensor_msgs/msg/JointState'
    assert b'float64[] effort' in schema.data


def test_a_bag_reaches_the_disk_before_its_name_and_its_name_before_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced, sync = [], os.fsync

    def noted(descriptor: int) -> None:
        synced.append(Path(os.readlink(f'/proc/self/fd/{descriptor}')))
        sync(descriptor)

    monkeypatch.setattr('os.fsync', noted)
    track = JointStateTrack('t', ['a'], np.arange(3.0), np.zeros((3, 1)))
    write_bag_folder(tmp_path / 'bag', [track])
    assert {path.suffix for path in synced[:-1]} == {'.mcap', '.yaml', ''}
    assert not any((tmp_path / 'bag') in path.parents for path in synced)
    assert synced[-1] == tmp_path
    synced.clear()
    write_mcap(tmp_path / 'a.mcap', [track])
    assert synced[-1] == tmp_path
    assert len(synced) == 2
