"""Bags as such: topics, and messages of types that no standard set has."""

from __future__ import annotations

import os
from pathlib import Path
import sqlite3
import subprocess
import sys

import numpy as np
import pytest
from recording.bag_files import moving, write_folder, write_raw

from lip_id_ros.errors import SourceError
from lip_id_ros.recording import Bag, Topic
from lip_id_ros.recording.bag_writer import JointStateTrack, write_mcap

TRACK = JointStateTrack('/x', ['a'], np.arange(3.0), np.zeros((3, 1)))


def odd_bag(folder: Path, definition: str) -> Path:
    """Write one Time message and give its type another name, which the bag defines."""
    data = bytes([0, 1, 0, 0, 5, 0, 0, 0, 7, 0, 0, 0])
    write_raw(folder, '/odd', 'builtin_interfaces/msg/Time', [data], '.db3')
    with sqlite3.connect(next(folder.glob('*.db3'))) as database:
        database.execute("UPDATE topics SET type='odd/msg/Odd'")
        database.execute(
            'UPDATE message_definitions SET topic_type=?, encoded_message_definition=?',
            ('odd/msg/Odd', definition),
        )
    (folder / 'metadata.yaml').unlink()
    return folder


def test_topics_are_listed_with_type_and_count(tmp_path: Path) -> None:
    path = write_folder(tmp_path / 'bag', [*moving(3, topic='/b'), *moving(2, topic='/a')])
    with Bag(path) as bag:
        kind = 'sensor_msgs/msg/JointState'
        assert bag.topics == (Topic('/a', kind, 2), Topic('/b', kind, 3))


def test_unknown_type_is_read_as_the_bag_defines_it(tmp_path: Path) -> None:
    with Bag(odd_bag(tmp_path / 'bag', 'int32 seconds\nuint32 nanoseconds')) as bag:
        ((_, message),) = bag.messages('/odd')
    assert (message.seconds, message.nanoseconds) == (5, 7)


def test_unreadable_definition_is_reported(tmp_path: Path) -> None:
    sentence = r'^the definition of odd/msg/Odd on /odd in .* cannot be read \(.*\); choose'
    with (
        Bag(odd_bag(tmp_path / 'bag', '?! = {')) as bag,
        pytest.raises(SourceError, match=sentence),
    ):
        list(bag.messages('/odd'))


def test_what_a_killed_write_left_is_removed_by_the_next(tmp_path: Path) -> None:
    target = tmp_path / 'a.mcap'
    program = (
        'import sys, os, signal\n'
        'from lip_id_ros.recording import bag_writer\n'
        'bag_writer._write = lambda bag, tracks: (bag.mkdir(), os.kill(os.getpid(), 9))\n'
        'bag_writer.write_mcap(sys.argv[1], [])\n'
    )
    ran = subprocess.run([sys.executable, '-c', program, str(target)], check=False)
    assert ran.returncode == -9
    (left,) = tmp_path.iterdir()
    os.utime(left, (0, 0))
    foreign = tmp_path / '.a.mcap.mine'
    foreign.mkdir()
    write_mcap(target, [TRACK])
    assert not left.exists()
    assert sorted(tmp_path.iterdir()) == [foreign, target]
