"""What is written can be read back, by others too, and is whole or absent."""

from __future__ import annotations

from dataclasses import replace
import os
from pathlib import Path
from typing import Any

from evaluation.stubs import Knowing
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from simulation.pendulums import swing

from lip_id_ros.dataset import concatenate
from lip_id_ros.errors import ConfigError
from lip_id_ros.evaluation import run
from lip_id_ros.evaluation.prediction_file import (
    predicted_values,
    write_prediction_mcap,
    write_prediction_npz,
    writer_for,
)
from lip_id_ros.files import read_npz
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


def test_npz_holds_everything_predicted(tmp_path: Path) -> None:
    data, estimator, path = swing(1), Knowing(torque_error=0.1), tmp_path / 'out.npz'

    write_prediction_npz(path, data, predicted_values(estimator, run(estimator, data)))

    arrays, header = read_npz(path)
    expected = estimator.predict(data.q, data.dq, data.ddq)
    assert header['format'] == 'lip_id_ros prediction'
    assert set(header['units']) == set(arrays) - {'segment', 'joint_names'}
    for name in ('tau', 'inertial', 'coriolis', 'gravity', 'friction', 'kinetic', 'potential'):
        np.testing.assert_array_equal(arrays[name], getattr(expected, name))
    np.testing.assert_array_equal(arrays['tau_measured'], data.tau)
    np.testing.assert_array_equal(arrays['t'], data.t)
    deviation = estimator.predict(data.q, data.dq, data.ddq, return_std=True).std
    assert deviation is not None
    assert deviation.potential is not None
    for name in ('tau', 'measurement', 'kinetic', 'potential'):
        np.testing.assert_array_equal(arrays[f'{name}_std'], getattr(deviation, name))
    assert arrays['joint_names'].tolist() == list(data.joint_names)


def test_npz_without_potential_energy(tmp_path: Path) -> None:
    estimator = Knowing(offset=None)

    write_prediction_npz(
        tmp_path / 'out.npz', swing(1), predicted_values(estimator, run(estimator, swing(1)))
    )

    arrays, _ = read_npz(tmp_path / 'out.npz')
    assert not {'potential', 'potential_std'} & set(arrays)


def test_mcap_shows_measured_beside_predicted(tmp_path: Path) -> None:
    data, estimator = swing(1), Knowing(torque_error=0.1)

    write_prediction_mcap(
        tmp_path / 'out.mcap', data, predicted_values(estimator, run(estimator, data))
    )

    found = messages(tmp_path / 'out.mcap')
    measured = [message for topic, message in found if topic == '/measured']
    predicted = [message for topic, message in found if topic == '/predicted']
    np.testing.assert_array_equal([list(message.effort) for message in measured], data.tau)
    np.testing.assert_array_equal([list(message.position) for message in measured], data.q)
    np.testing.assert_allclose(
        [list(message.effort) for message in predicted],
        estimator.predict(data.q, data.dq, data.ddq).tau,
    )
    np.testing.assert_allclose([seconds(message) for message in predicted], data.t, atol=1e-9)
    assert tuple(predicted[0].name) == data.joint_names


def test_mcap_has_the_times_of_the_clock_and_no_stamp_twice(tmp_path: Path) -> None:
    first, second = (
        replace(swing(seed), provenance={'sources': [{'source': 'a', **start}]})
        for seed, start in ((1, {'start_s': 1.7e9}), (2, {'start_s': 1.7e9 + 1.0}))
    )
    for parts in ([first, second], [first, replace(second, provenance={})]):
        data = concatenate(parts)
        found = predicted_values(Knowing(), run(Knowing(), data))
        write_prediction_mcap(tmp_path / 'out.mcap', data, found)
        shown = messages(tmp_path / 'out.mcap')
        stamps = np.array([seconds(x) for topic, x in shown if topic == '/measured'])
        assert (np.diff(stamps) > 0.0).all()
        half = first.n_samples
        np.testing.assert_allclose(stamps[:half], 1.7e9 + first.t, atol=1e-6)
        np.testing.assert_allclose(np.diff(stamps[half:]), np.diff(second.t), atol=1e-6)


def test_mcap_has_energies_and_standard_deviations(tmp_path: Path) -> None:
    data, estimator = swing(1), Knowing(torque_error=0.1)

    write_prediction_mcap(
        tmp_path / 'out.mcap', data, predicted_values(estimator, run(estimator, data))
    )

    found = messages(tmp_path / 'out.mcap')
    expected = estimator.predict(data.q, data.dq, data.ddq)
    std = estimator.predict(data.q, data.dq, data.ddq, return_std=True).std
    assert std is not None
    numbers = {
        '/kinetic_energy': expected.kinetic,
        '/kinetic_energy_std': std.kinetic,
        '/potential_energy': expected.potential,
        '/potential_energy_std': std.potential,
    }
    assert {topic for topic, _ in found} == {
        '/measured', '/predicted', '/predicted_std', '/measurement_std', *numbers
    }  # fmt: skip
    for name, values in numbers.items():
        assert values is not None
        shown = [message.data for topic, message in found if topic == name]
        np.testing.assert_allclose(shown, values, err_msg=name)
    for topic, values in {'/predicted_std': std.tau, '/measurement_std': std.measurement}.items():
        spread = [list(message.effort) for name, message in found if name == topic]
        np.testing.assert_allclose(spread, values)


def test_mcap_without_potential_energy(tmp_path: Path) -> None:
    estimator = Knowing(offset=None)

    write_prediction_mcap(
        tmp_path / 'out.mcap', swing(1), predicted_values(estimator, run(estimator, swing(1)))
    )

    topics = {topic for topic, _ in messages(tmp_path / 'out.mcap')}
    assert not {'/potential_energy', '/potential_energy_std'} & topics
    assert '/kinetic_energy' in topics


def test_mcap_says_what_plotting_tools_need(tmp_path: Path) -> None:
    """PlotJuggler and Foxglove decode by profile, schema and encoding, without ROS."""
    found = predicted_values(Knowing(), run(Knowing(), swing(1)))
    write_prediction_mcap(tmp_path / 'out.mcap', swing(1), found)

    with (tmp_path / 'out.mcap').open('rb') as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert reader.get_header().profile == 'ros2'
    assert summary is not None
    schemas = {
        channel.topic: summary.schemas[channel.schema_id] for channel in summary.channels.values()
    }
    assert {channel.message_encoding for channel in summary.channels.values()} == {'cdr'}
    assert {schema.encoding for schema in schemas.values()} == {'ros2msg'}
    assert schemas['/predicted_std'].name == 'sensor_msgs/msg/JointState'
    assert b'float64[] effort' in schemas['/predicted'].data
    assert schemas['/kinetic_energy'].name == 'std_msgs/msg/Float64'
    with AnyReader([tmp_path / 'out.mcap']) as bag:
        connections = [each for each in bag.connections if each.topic == '/kinetic_energy']
        stamps = [stamp for _, stamp, _ in bag.messages(connections)]
    np.testing.assert_allclose(1e-9 * np.array(stamps), swing(1).t, atol=1e-9)


@pytest.mark.parametrize('name', ['out', 'out.csv', 'npz'])
def test_a_suffix_that_names_no_format(name: str) -> None:
    with pytest.raises(ConfigError, match=rf'{name} must end in .npz or .mcap'):
        writer_for(name)


def test_the_suffix_chooses_the_format() -> None:
    assert writer_for('a.npz') is write_prediction_npz
    assert writer_for('b/a.mcap') is write_prediction_mcap


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
