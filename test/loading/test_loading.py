"""Bags and data sets, alone and together, through the one entry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from evaluation.models import small_model
import numpy as np
from preprocessing.motions import recording, uniform
import pytest
from recording.bag_files import State, write_folder
from simulation.pendulums import swing

import lip_id_ros as lip
from lip_id_ros import simulation
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import ConfigError, DataError, SourceError
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.settings import Config, FitSettings, PreprocessingSettings, RecordingSettings

T = uniform(300, 100.0)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return write_bag(tmp_path / 'bag')


def write_bag(
    path: Path, names: tuple[str, str] = ('shoulder', 'elbow'), factor: float = 1.0
) -> Path:
    samples = recording(T)
    rows = zip(T, samples.position, samples.velocity, factor * samples.effort, strict=True)
    return write_folder(
        path, [State(round(1e9 * t), q, dq, tau, names) for t, q, dq, tau in rows], '.mcap'
    )


def test_bag(bag: Path) -> None:
    data = load_dataset(bag)
    expected = preprocess(recording(T))
    np.testing.assert_allclose(data.ddq, expected.ddq, atol=1e-5)
    assert data.provenance['sources'][0]['source'] == str(bag)


def test_settings_reach_every_stage(bag: Path) -> None:
    config = Config(
        recording=RecordingSettings(joints=('elbow',), effort_scale=(2.0,)),
        preprocessing=PreprocessingSettings(cutoff_hz=2.0, decimate=1, max_samples=50),
    )
    data = load_dataset(str(bag), config)
    assert data.joint_names == ('elbow',)
    assert data.n_samples == 50
    assert data.provenance['selected']['samples'] == 50


def test_bag_and_data_set_together(bag: Path, tmp_path: Path) -> None:
    file = tmp_path / 'data.npz'
    load_dataset(bag).with_joints(['elbow', 'shoulder']).save(file)
    data = load_dataset([bag, file])
    half = data.n_samples // 2
    np.testing.assert_array_equal(data.q[:half], data.q[half:])
    np.testing.assert_array_equal(np.unique(data.segment), [0, 1])
    assert len(data.provenance['sources']) == 2
    assert load_dataset([bag, file], Config(preprocessing=PreprocessingSettings(max_samples=9)))


def test_data_set_is_taken_as_it_is_but_for_its_joints(bag: Path, tmp_path: Path) -> None:
    file = tmp_path / 'data.npz'
    original = load_dataset(bag)
    original.save(file)
    config = Config(recording=RecordingSettings(joints=('elbow',), effort_scale=(9.0, 9.0)))
    np.testing.assert_array_equal(load_dataset(file, config).tau, original.tau[:, 1:])
    np.testing.assert_array_equal(load_dataset([file]).tau, original.tau)


def test_a_bare_data_set_has_the_joint_types_of_the_settings(tmp_path: Path) -> None:
    columns = np.arange(20.0).reshape(10, 2)
    np.savez(tmp_path / 'bare.npz', q=columns, dq=columns, ddq=columns, tau=columns)
    types = ('prismatic', 'revolute')
    config = Config(recording=RecordingSettings(joint_types=types))
    assert load_dataset(tmp_path / 'bare.npz', config).joint_types == types
    assert load_dataset(tmp_path / 'bare.npz').joint_types == ('revolute',) * 2


def test_other_joints_are_reported(bag: Path, tmp_path: Path) -> None:
    other = write_bag(tmp_path / 'other', ('a', 'b'))
    with pytest.raises(DataError, match=r'^sources must have the same joints, not shoulder,'):
        load_dataset([bag, other])


def test_no_source_is_reported() -> None:
    with pytest.raises(SourceError, match=r'^at least one recording or data set is needed, but n'):
        load_dataset([])


def test_progress_names_the_stages(bag: Path) -> None:
    stages = []
    load_dataset(bag, progress=lambda stage, done, total: stages.append(stage))
    assert list(dict.fromkeys(stages)) == ['reading bag', 'preprocessing']


def test_recordings_are_numbered(tmp_path: Path) -> None:
    bags = [write_bag(tmp_path / f'bag{k}', factor=1.0 + 0.1 * k) for k in range(3)]
    data = load_dataset(bags)
    n = data.n_samples // 3
    np.testing.assert_array_equal(data.recording, np.repeat([0, 1, 2], n))
    np.testing.assert_array_equal(data.segment, np.repeat([0, 1, 2], n))
    np.testing.assert_allclose(data.tau[2 * n :], 1.2 * data.tau[:n], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize('first', [('shoulder', 'elbow'), ('elbow', 'shoulder')])
def test_values_per_joint_belong_to_the_joints_of_the_first_recording(
    tmp_path: Path, first: tuple[str, str]
) -> None:
    """Columns of a second recording in another order have the scale of their joint."""
    write_bag(tmp_path / 'a', first)
    write_bag(tmp_path / 'b', (first[1], first[0]), factor=1.5)
    config = Config(
        recording=RecordingSettings(
            effort_scale=(2.0, 3.0), joint_types=('revolute', 'prismatic')
        ),
        preprocessing=PreprocessingSettings(max_samples=0),
    )
    plain = load_dataset([tmp_path / 'a', tmp_path / 'b'])
    data = load_dataset([tmp_path / 'a', tmp_path / 'b'], config)
    assert data.joint_names == plain.joint_names == first
    assert data.joint_types == ('revolute', 'prismatic')
    np.testing.assert_allclose(data.tau, plain.tau * [2.0, 3.0], rtol=1e-12)


def test_a_bare_data_set_without_gravity(tmp_path: Path) -> None:
    columns = np.arange(20.0).reshape(10, 2)
    np.savez(tmp_path / 'bare.npz', q=columns, dq=columns, ddq=columns, tau=columns)
    config = Config(recording=RecordingSettings(gravity_compensated=True))
    data = load_dataset(tmp_path / 'bare.npz', config)
    assert data.gravity_compensated
    data.save(tmp_path / 'said.npz')
    assert load_dataset(tmp_path / 'said.npz').gravity_compensated
    assert not load_dataset(tmp_path / 'bare.npz').gravity_compensated


@pytest.mark.parametrize('sources', [None, 3, [None], b'bag'])
def test_what_is_no_path_is_refused(sources: Any) -> None:
    with pytest.raises(SourceError, match=r'^a source must be a path, not .*; pass one path'):
        load_dataset(sources)


@pytest.mark.parametrize('settings', [{}, {'preprocessing.cutoff_hz': 3.0}, FitSettings()])
def test_settings_of_another_type_are_refused(settings: Any) -> None:
    with pytest.raises(ConfigError, match=r'^the settings of load_dataset must be a Config, not '):
        load_dataset('bag', settings)


def cautions(data: Dataset) -> list[str]:
    return lip.fit_cautions(replace(small_model(), provenance=data.provenance))


def write_copied(path: Path) -> None:
    """Write a recording whose first effort stands for all."""
    data = swing(1, rate=50.0)
    simulation.write_bag(path, replace(data, tau=np.repeat(data.tau[:, :1], 3, axis=1)))


def test_findings_stay_with_their_recording_wherever_it_goes(tmp_path: Path) -> None:
    write_copied(tmp_path / 'copied')
    simulation.write_bag(tmp_path / 'sound', swing(2, rate=50.0))
    sound, copied = (lip.load_dataset(tmp_path / name) for name in ('sound', 'copied'))
    copied.select(range(50)).save(tmp_path / 'part.npz')
    joined = concatenate([sound, Dataset.load(tmp_path / 'part.npz')])
    (found,) = (each for each in cautions(joined) if 'effort_copied' in each)
    assert found.endswith(f'In {tmp_path / "copied"}.')
    together = lip.load_dataset([tmp_path / 'sound', tmp_path / 'copied'])
    assert found in cautions(together)


def test_short_recordings_are_a_caution_where_they_are_short_together(tmp_path: Path) -> None:
    paths = [tmp_path / f'{seed}' for seed in range(4)]
    for seed, path in enumerate(paths):
        simulation.write_bag(path, swing(seed, rate=50.0))
    some, all_of_them = (cautions(lip.load_dataset(each)) for each in (paths[:2], paths))
    assert any('warning short' in each for each in some)
    assert not any('warning short' in each for each in all_of_them)
