"""Data sets in files: whole, bare, broken and hostile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dataset.examples import dataset, of_recordings
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from kernels.cases import random_states
import numpy as np
import pytest

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.files import write_npz


def test_file_keeps_everything(tmp_path: Path) -> None:
    data = dataset(
        tau_noiseless=np.ones((6, 2)),
        potential=np.arange(6.0),
        gravity_compensated=True,
        provenance={'sources': [{'source': 'robot.mcap', 'dropped': {'missing joint': 3}}]},
    )
    data.save(tmp_path / 'data.npz')
    loaded = Dataset.load(tmp_path / 'data.npz')
    for name, value in vars(data).items():
        np.testing.assert_array_equal(getattr(loaded, name), value, err_msg=name)
    assert loaded.kinetic is None
    assert list(tmp_path.iterdir()) == [tmp_path / 'data.npz']


@given(
    hnp.arrays(
        np.float64,
        st.tuples(st.integers(1, 5), st.integers(1, 4)),
        elements=st.floats(allow_nan=False, allow_infinity=False),
    )
)
def test_bare_file_gets_documented_defaults(
    tmp_path_factory: pytest.TempPathFactory, tau: np.ndarray[Any, Any]
) -> None:
    path = tmp_path_factory.mktemp('bare') / 'bare.npz'
    np.savez(path, q=tau, dq=tau, ddq=tau, tau=tau, comment=np.array('from elsewhere'))
    data = Dataset.load(path)
    np.testing.assert_array_equal(data.tau, tau)
    np.testing.assert_array_equal(data.t, np.arange(len(tau), dtype=float))
    assert data.joint_names == tuple(f'joint_{k + 1}' for k in range(tau.shape[1]))
    assert set(data.joint_types) == {'revolute'}
    assert not data.segment.any()
    assert data.provenance['sources'][0]['defaults'] == [
        't',
        'joint_names',
        'joint_types',
        'segment',
        'gravity_compensated',
    ]


def test_bare_file_of_one_joint_and_a_step(tmp_path: Path) -> None:
    values = np.arange(3)
    names = np.array([b'slider'])
    path = tmp_path / 'bare.npz'
    np.savez(path, q=values, dq=values, ddq=values, tau=values, dt=0.5, joint_names=names)
    data = Dataset.load(path)
    assert data.q.shape == (3, 1)
    assert data.joint_names == ('slider',)
    np.testing.assert_array_equal(data.t, [0.0, 0.5, 1.0])


@pytest.mark.parametrize(
    ('arrays', 'sentence'),
    [
        ({'q': np.zeros((2, 1))}, r'bare.npz must hold .* but dq, ddq, tau is missing beside q; '),
        ({}, r'bare.npz must hold arrays .* tau is missing beside nothing; save them too.$'),
    ],
)
def test_incomplete_file_is_refused(tmp_path: Path, arrays: dict[str, Any], sentence: str) -> None:
    np.savez(tmp_path / 'bare.npz', **arrays)
    with pytest.raises(DataError, match=sentence):
        Dataset.load(tmp_path / 'bare.npz')


@pytest.mark.parametrize(
    ('arrays', 'sentence'),
    [
        ({'dt': -1.0}, r'^dt in .*bare.npz must be one positive number of seconds, not -1.0.$'),
        ({'dt': 'x'}, r"^dt in .*bare.npz must be one positive number of seconds, not 'x'.$"),
        ({'dt': [1, 2]}, r'^dt in .*bare.npz must be one positive number .*, not \[1, 2\].$'),
        ({'tau': np.zeros((2, 2))}, r'^in .*bare.npz, tau must have shape \(2, 1\) like q, not '),
        ({'q': np.full((2, 1), None)}, r'bare.npz is not a data set \(.*\); write one with'),
        ({'q': np.zeros((7, 500))}, r'^q in .*bare.npz must .*\(7, 500\), more .*; transpose the'),
        ({'q': 1.0}, r'^in .*bare.npz, q must have shape \(samples, joints\)'),
    ],
)
def test_contradiction_is_refused(tmp_path: Path, arrays: dict[str, Any], sentence: str) -> None:
    whole = dict.fromkeys(('q', 'dq', 'ddq', 'tau'), np.zeros((2, 1)))
    np.savez(tmp_path / 'bare.npz', **(whole | arrays))
    with pytest.raises(DataError, match=sentence):
        Dataset.load(tmp_path / 'bare.npz')


@pytest.mark.parametrize('content', [b'', b'PK', b'not a data set', b'PK\x03\x04' + bytes(40)])
def test_file_that_is_no_archive_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / 'other.npz').write_bytes(content)
    with pytest.raises(DataError, match=r'other.npz is not a data set \(.*\); write one with `li'):
        Dataset.load(tmp_path / 'other.npz')


@pytest.mark.parametrize(
    ('header', 'sentence'),
    [
        ({'format': 'lip_id_ros model'}, r'x.npz must be a data set, but it is a lip_id_ros'),
        (
            {'format': 'lip_id_ros data set', 'version': 99},
            r'x.npz must be a data set of version 1, not 99; write it again with this version',
        ),
    ],
)
def test_foreign_header_is_refused(tmp_path: Path, header: dict[str, Any], sentence: str) -> None:
    write_npz(tmp_path / 'x.npz', {'q': np.zeros((2, 1))}, header)
    with pytest.raises(DataError, match=sentence):
        Dataset.load(tmp_path / 'x.npz')


def test_absent_file_passes_through(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Dataset.load(tmp_path / 'absent.npz')


def test_provenance_that_is_no_mapping_is_refused(tmp_path: Path) -> None:
    whole = dict.fromkeys(('q', 'dq', 'ddq', 'tau'), np.zeros((2, 1)))
    write_npz(tmp_path / 'x.npz', whole, {'provenance': 5})
    with pytest.raises(DataError, match=r"the provenance in .*x.npz must be a mapping, not '5'; "):
        Dataset.load(tmp_path / 'x.npz')


def test_the_number_of_the_recording_is_kept(tmp_path: Path) -> None:
    data = of_recordings()
    data.save(tmp_path / 'data.npz')
    again = Dataset.load(tmp_path / 'data.npz')
    np.testing.assert_array_equal(again.recording, [3, 3, 3, 3, 7, 7])
    np.testing.assert_array_equal(data.select([0, 4]).recording, [3, 7])
    np.testing.assert_array_equal(data.split(0.5)[1].recording, [3, 7, 7])
    np.testing.assert_array_equal(data.with_joints(['elbow']).recording, data.recording)
    joined = concatenate([data, dataset(), data])
    np.testing.assert_array_equal(
        joined.recording, [0] * 4 + [1] * 2 + [2] * 6 + [3] * 4 + [4] * 2
    )
    np.testing.assert_array_equal(
        joined.segment, np.repeat(np.arange(8), [2, 2, 2, 3, 3, 2, 2, 2])
    )


TYPES = ('revolute', 'prismatic')
SIZES = {'n_samples': st.integers(1, 40), 'count': st.integers(1, 50), 'seed': st.integers(0, 99)}


def spread(types: tuple[str, ...], q: Array, dq: Array, ddq: Array, count: int) -> IntArray:
    data = Dataset(
        t=np.arange(float(len(q))),
        q=q,
        dq=dq,
        ddq=ddq,
        tau=q,
        joint_names=tuple(f'joint_{i + 1}' for i in range(q.shape[1])),
        joint_types=types,
        segment=np.zeros(len(q), dtype=np.int64),
    )
    return data.covering(count)


@given(**SIZES)
def test_chosen_rows(n_samples: int, count: int, seed: int) -> None:
    q, dq, ddq = random_states(n_samples, 2, np.random.default_rng(seed))
    rows = spread(TYPES, q, dq, ddq, count)
    assert len(rows) == min(count, n_samples)
    assert (np.diff(rows) > 0).all()
    assert rows[0] >= 0
    assert rows[-1] < n_samples


@given(**SIZES)
def test_more_samples_keep_the_fewer(n_samples: int, count: int, seed: int) -> None:
    """Farthest-point selection is greedy: a larger choice holds the smaller."""
    q, dq, ddq = random_states(n_samples, 2, np.random.default_rng(seed))
    fewer = spread(TYPES, q, dq, ddq, count)
    assert set(fewer) <= set(spread(TYPES, q, dq, ddq, count + 1))


# Position, velocity and acceleration of both joints, but for the angle, which has no extremes.
NUMBERS = [(0, 1), (1, 0), (1, 1), (2, 0), (2, 1)]


@given(place=st.integers(0, 29), number=st.sampled_from(NUMBERS))
def test_an_extreme_sample_is_among_the_first_two(place: int, number: tuple[int, int]) -> None:
    states = random_states(30, 2, np.random.default_rng(0))
    states[number[0]][place, number[1]] = 50.0
    assert place in spread(TYPES, *states, 2)


@given(repeats=st.integers(2, 5), count=st.integers(4, 7))
def test_repeated_samples_are_chosen_once(repeats: int, count: int) -> None:
    q, dq, ddq = (
        np.repeat(x, repeats, axis=0) for x in random_states(4, 2, np.random.default_rng(0))
    )
    rows = spread(TYPES, q, dq, ddq, count)
    np.testing.assert_array_equal(rows // repeats, np.arange(4))


def test_turns_are_the_same_angle() -> None:
    q, dq, ddq = random_states(20, 1, np.random.default_rng(0))
    expected = spread(('revolute',), q, dq, ddq, 6)
    turns = 2.0 * np.pi * np.random.default_rng(1).integers(-3, 4, size=q.shape)
    np.testing.assert_array_equal(spread(('revolute',), q + turns, dq, ddq, 6), expected)
