"""The description of bags and data sets by `lip_id inspect`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from recording.bag_files import (
    moving,
    State,
    STEP_NS,
    write_controller_states,
    write_file,
    write_folder,
)

from lip_id_ros.dataset import Dataset
from lip_id_ros.preprocessing import describe


def test_bag(tmp_path: Path) -> None:
    states = [state for k, state in enumerate(moving(100)) if k not in range(40, 60)]
    states.append(State(99 * STEP_NS))
    states.append(State(100 * STEP_NS, [0.0], [0.0], [0.0], ['finger']))
    path = write_folder(tmp_path / 'bag', states, '.mcap')
    description = json.loads(json.dumps(describe(path), allow_nan=False))
    assert description['kind'] == 'rosbag2 folder'
    assert description['topics'] == [
        {'name': '/joint_states', 'type': 'sensor_msgs/msg/JointState', 'messages': 82}
    ]
    (recording,) = description['recordings']
    assert recording['joints'] == ['shoulder', 'elbow']
    assert recording['samples'] == 80
    assert recording['other_joints'] == ['finger']
    assert recording['dropped'] == {'stamp repeated': 1, 'only foreign joints': 1}
    assert recording['timing']['rate_hz'] == pytest.approx(100.0)
    assert recording['timing']['duration_s'] == pytest.approx(0.99)
    assert recording['timing']['jitter_s'] == pytest.approx(0.0, abs=1e-9)
    assert recording['timing']['gaps'] == 1
    (gap,) = recording['timing']['longest_gaps']
    assert gap == pytest.approx({'at_s': 0.39, 'length_s': 0.21})
    assert recording['ranges']['elbow']['position'] == pytest.approx([-1.98, 0.0])
    assert recording['ranges']['shoulder']['velocity'] == [1.0, 1.0]


def test_bag_without_velocity_effort_or_time(tmp_path: Path) -> None:
    path = write_folder(tmp_path / 'bag', moving(1, velocity=(), effort=()))
    (recording,) = json.loads(json.dumps(describe(path), allow_nan=False))['recordings']
    assert recording['timing']['rate_hz'] is None
    ranges = recording['ranges']['shoulder']
    assert ranges == {'position': [0.0, 0.0], 'velocity': None, 'effort': None}


def test_every_topic_with_joint_samples_is_described(tmp_path: Path) -> None:
    states = [*moving(3, topic='/left'), *moving(4, topic='/right')]
    description = describe(write_folder(tmp_path / 'bag', states))
    assert [each['topic'] for each in description['recordings']] == ['/left', '/right']


def test_topic_that_cannot_be_read_is_told_beside_the_others(tmp_path: Path) -> None:
    folder = write_controller_states(tmp_path / 'bag', 'new', [{}])
    (storage,) = folder.glob('*.mcap')
    storage.write_bytes(
        storage.read_bytes().replace(b'string[] joint_names', b'?! = {{ joint_names ')
    )
    write_file(tmp_path / 'good', moving(5), '.mcap').rename(folder / 'good.mcap')
    description = describe(folder)
    assert [each['topic'] for each in description['recordings']] == ['/joint_states']
    assert len(description['topics']) == 2
    (note,) = description['notes']
    assert note.startswith('the definition of control_msgs/msg/JointTrajectoryControllerState on ')


def test_bag_without_joints_has_its_notes(tmp_path: Path) -> None:
    path = write_file(tmp_path / 'bag', moving(5), '.mcap')
    content = path.read_bytes()
    path.write_bytes(content[:60])
    description = describe(path)
    assert description['recordings'] == []
    assert description['notes'] == [
        'bag.mcap: the file was cut short or never closed, its last chunk was read as far as it '
        'goes',
        'bag.mcap: bytes 43 to 60 are damaged: the head of a chunk',
    ]


def test_data_set(tmp_path: Path) -> None:
    q = np.arange(8.0).reshape(4, 2)
    data = Dataset(
        t=np.array([0.0, 0.1, 0.0, 0.1]),
        q=q,
        dq=q,
        ddq=q,
        tau=-q,
        joint_names=('a', 'b'),
        joint_types=('revolute', 'prismatic'),
        segment=np.array([0, 0, 1, 1]),
        provenance={'seed': 1},
    )
    data.save(tmp_path / 'data.npz')
    description = json.loads(json.dumps(describe(tmp_path / 'data.npz'), allow_nan=False))
    assert description['kind'] == 'data set'
    assert description['samples'] == 4
    assert [segment['rate_hz'] for segment in description['segments']] == pytest.approx([10, 10])
    assert description['ranges']['b']['tau'] == [-7.0, -1.0]
    assert description['joint_types'] == ['revolute', 'prismatic']
    assert description['provenance'] == {'seed': 1}
