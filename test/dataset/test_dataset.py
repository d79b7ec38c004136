"""The data set: checked, read-only, cut and joined."""

from __future__ import annotations

import math
from typing import Any

from dataset.examples import dataset, N_JOINTS, N_SAMPLES
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.dataset import concatenate, cutoffs_hz, Dataset
from lip_id_ros.dataset.formats import sample_interval_s
from lip_id_ros.dataset.subsets import contiguous_cuts
from lip_id_ros.errors import DataError, ShapeError


def with_nan(shape: tuple[int, ...], at: tuple[int, ...]) -> np.ndarray[Any, Any]:
    array = np.zeros(shape)
    array[at] = np.nan
    return array


class NotAnArray:
    """As a tensor of torch behaves that keeps its gradient."""

    def __array__(self, *arguments: object, **options: object) -> None:
        raise RuntimeError('it requires a gradient')


@pytest.mark.parametrize(
    ('changes', 'error', 'sentence'),
    [
        ({'q': np.zeros(3)}, ShapeError, r'^q must have shape \(samples, joints\) .*not \(3,\).$'),
        (
            {'q': np.zeros((6, 0))},
            ShapeError,
            r'^q must have shape .* one of each, not \(6, 0\).$',
        ),
        (
            {'q': np.zeros((0, 2))},
            ShapeError,
            r'^q must have shape .* one of each, not \(0, 2\).$',
        ),
        ({'q': [[1], [1, 2]]}, ShapeError, r'^q must have rows of equal length \(.*\).$'),
        ({'q': [['a', 'b']]}, DataError, r'^q must hold numbers, not <U1; convert it first.$'),
        ({'q': [[None]]}, DataError, r'^q must hold numbers, not object; convert it first.$'),
        ({'dq': np.zeros((6, 3))}, ShapeError, r'^dq must have shape \(6, 2\) .*not \(6, 3\).$'),
        ({'tau': np.zeros((5, 2))}, ShapeError, r'^tau must have shape \(6, 2\) .*not \(5, 2\).$'),
        ({'kinetic': np.zeros(5)}, ShapeError, r'^kinetic must have shape \(6,\) .*not \(5,\).$'),
        ({'segment': [0]}, ShapeError, r'^segment must have shape \(6,\) like q, not \(1,\).$'),
        ({'segment': [0.5] * 6}, DataError, r'^segment must hold whole numbers; number segments'),
        ({'segment': [1e300] * 6}, DataError, r'^segment must hold whole numbers; number segment'),
        ({'joint_names': 'ab'}, DataError, r"^joint_names must be a list with one .* not 'ab'\.$"),
        ({'joint_types': 5}, DataError, r'^joint_types must be a list with one .*, not 5\.$'),
        (
            {'q': np.ma.masked_less(np.arange(12.0).reshape(6, 2), 3.0)},
            DataError,
            r'^q must have every value, but some are masked; select the others\.$',
        ),
        (
            {'q': NotAnArray()},
            DataError,
            r'^q must become an array of numpy, but cannot \(it requires a gradient\)\.$',
        ),
        ({'joint_names': ('a',)}, ShapeError, r'^joint_names must name the 2 joints .*not 1.$'),
        ({'joint_types': ()}, ShapeError, r'^joint_types must name the 2 joints of q, not 0.$'),
        ({'joint_names': ('a', 'a')}, DataError, r"^joint_names .* unique, but 'a' comes twice.$"),
        ({'joint_names': ('a', '')}, DataError, r'^every joint needs a name, but .* is empty.$'),
        (
            {'joint_types': ('revolute', 'linear')},
            DataError,
            r"^a joint type must be revolute or prismatic, not 'linear'.$",
        ),
        (
            {'tau': with_nan((6, 2), (3, 1))},
            DataError,
            r'^tau must be finite, but sample 3 of elbow is nan; remove such samples.$',
        ),
        ({'t': with_nan((6,), (2,))}, DataError, r'^t must be finite, but sample 2 is nan; '),
        (
            {'t': [0, 1, 0.5, 0, 1, 2]},
            DataError,
            r'^t must not decrease within a segment, but goes from 1 to 0.5 s at sample 2; sort ',
        ),
        (
            {'segment': [0, 0, 1, 1, 0, 0]},
            DataError,
            r'^samples of one segment must lie together, but segment 0 comes back after another; ',
        ),
    ],
)
def test_contradictions_are_refused(
    changes: dict[str, Any], error: type[DataError], sentence: str
) -> None:
    with pytest.raises(error, match=sentence):
        dataset(**changes)


def test_arrays_are_copies_and_read_only() -> None:
    q = np.zeros((N_SAMPLES, N_JOINTS), np.float32)
    data = dataset(q=q)
    q[0, 0] = 1.0
    assert data.q[0, 0] == 0.0
    assert data.q.dtype == np.float64
    with pytest.raises(ValueError, match='read-only'):
        data.q[0, 0] = 1.0
    assert (data.n_samples, data.n_joints) == (N_SAMPLES, N_JOINTS)


def test_time_may_go_back_where_a_segment_begins() -> None:
    assert dataset(t=[5, 6, 6, 0, 1, 2]).t[3] == 0.0


@pytest.mark.parametrize('indices', [[4, 1, 1], [False, True, False, False, True, False]])
def test_select_keeps_the_order_of_time(indices: list[int]) -> None:
    data = dataset(kinetic=np.arange(6.0))
    some = data.select(indices)
    np.testing.assert_array_equal(some.q, data.q[[1, 4]])
    np.testing.assert_array_equal(some.segment, [0, 4])
    np.testing.assert_array_equal(some.kinetic, [1.0, 4.0])


@pytest.mark.parametrize('indices', [np.zeros(6, bool), []])
def test_select_refuses_nothing(indices: Any) -> None:
    with pytest.raises(DataError, match=r'^at least one of 6 samples must be selected, not 0.$'):
        dataset().select(indices)


@pytest.mark.parametrize('indices', [[6], [0.5], [True] * 5, None])
def test_select_refuses_what_are_no_rows(indices: Any) -> None:
    with pytest.raises(DataError, match=r'^rows must be numbers below 6 or a mask of so many'):
        dataset().select(indices)


@given(st.floats(min_value=0.1, max_value=0.9))
def test_split_cuts_once_in_time(fraction: float) -> None:
    data = dataset()
    first, rest = data.split(fraction)
    assert first.n_samples == round(6 * fraction)
    np.testing.assert_array_equal(np.concatenate([first.tau, rest.tau]), data.tau)


@pytest.mark.parametrize('fraction', [0.0, 1.0, 0.01, -1.0, 7.0, math.nan, math.inf])
def test_split_refuses_an_empty_part(fraction: float) -> None:
    with pytest.raises(DataError, match=r'of 6 samples leaves one part of the split empty;'):
        dataset().split(fraction)


def test_joints_are_chosen_by_name() -> None:
    data = dataset()
    turned = data.with_joints(['elbow', 'shoulder'])
    assert turned.joint_types == ('prismatic', 'revolute')
    np.testing.assert_array_equal(turned.tau, data.tau[:, ::-1])
    sentence = r'^joint hand expected in the data set, which has shoulder, elbow; correct the'
    with pytest.raises(DataError, match=sentence):
        data.with_joints(['hand'])


def test_concatenate_matches_joints_by_name_and_keeps_segments_apart() -> None:
    first = dataset(kinetic=np.zeros(6), provenance={'sources': [{'source': 'a'}]})
    second = dataset(provenance={'seed': 3}).with_joints(['elbow', 'shoulder'])
    joined = concatenate([first, second])
    np.testing.assert_array_equal(joined.q, np.concatenate([first.q, first.q]))
    np.testing.assert_array_equal(joined.segment, np.repeat([0, 1, 2, 3], 3))
    assert joined.joint_types == ('revolute', 'prismatic')
    assert joined.kinetic is None
    assert joined.provenance == {'sources': [{'source': 'a'}, {'seed': 3}]}


@pytest.mark.parametrize(
    ('changes', 'sentence'),
    [
        (
            {'joint_names': ('shoulder', 'wrist')},
            r'^sources must have the same joints, not shoulder, elbow and shoulder, wrist; choose',
        ),
        (
            {'joint_types': ('revolute', 'revolute')},
            r'^sources must agree on joint types, not revolute, prismatic and revolute, revolute;',
        ),
        ({'gravity_compensated': True}, r'^sources with and without gravity in their torques can'),
    ],
)
def test_concatenate_refuses_other_arms(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(DataError, match=sentence):
        concatenate([dataset(), dataset(**changes)])


def test_concatenate_keeps_the_segments_of_three_data_sets_apart() -> None:
    one = dataset()
    joined = concatenate([one, one, one])
    each = np.unique(one.segment).size
    assert np.unique(joined.segment).tolist() == list(range(3 * each))
    assert (np.diff(joined.segment) >= 0).all()
    assert np.unique(joined.recording).size == 3 * np.unique(one.recording).size


def test_concatenate_keeps_what_copies_each_data_set_left_out() -> None:
    copies = [{'source': name, 'samples': 6, 'repeated': 2} for name in ('a', 'b')]
    parts = [dataset(provenance={'sources': [], 'copies': [each]}) for each in copies]
    assert concatenate(parts).provenance['copies'] == copies


def test_concatenate_refuses_nothing() -> None:
    with pytest.raises(DataError, match=r'^at least one data set is needed to concatenate'):
        concatenate([])


def test_from_arrays_fills_in_names_types_and_times() -> None:
    rng = np.random.default_rng(0)
    q, dq, ddq, tau = rng.normal(size=(4, 5, 3))
    data = Dataset.from_arrays(q, dq, ddq.tolist(), tau)
    np.testing.assert_array_equal(data.ddq, ddq)
    assert data.joint_names == ('joint_1', 'joint_2', 'joint_3')
    assert data.joint_types == ('revolute',) * 3
    np.testing.assert_array_equal(data.t, np.arange(5.0))
    assert not data.segment.any()
    assert not data.recording.any()
    given = Dataset.from_arrays(
        q,
        dq,
        ddq,
        tau,
        ['a', 'b', 'c'],
        ['revolute', 'prismatic', 'revolute'],
        t=0.1 * np.arange(5),
    )
    assert given.joint_names == ('a', 'b', 'c')
    assert given.joint_types[1] == 'prismatic'
    assert given.t[-1] == pytest.approx(0.4)
    one = Dataset.from_arrays(*rng.normal(size=(4, 5)))
    assert one.q.shape == (5, 1)


@pytest.mark.parametrize(
    ('changes', 'error', 'sentence'),
    [
        ({'q': np.zeros((2, 2, 2))}, ShapeError, r'^q must have shape \(samples, joints\) .*not'),
        ({'q': 1.0}, ShapeError, r'^q must have shape \(samples, joints\) .*not \(\)\.$'),
        ({'tau': np.zeros((4, 2))}, ShapeError, r'^tau must have shape \(5, 2\) like q, not \(4'),
        ({'dq': [['x', 'y']] * 5}, DataError, r'^dq must hold numbers, not <U1; convert it first'),
        (
            {'joint_names': ['a']},
            ShapeError,
            r'^joint_names must name the 2 joints of q, not 1\.$',
        ),
        ({'joint_types': ['ball', 'ball']}, DataError, r'^a joint type must be revolute or pris'),
        ({'t': [0, 1, 2, 1, 4]}, DataError, r'^t must not decrease within a segment, but goes fr'),
    ],
)
def test_from_arrays_names_what_is_wrong(
    changes: dict[str, Any], error: type[DataError], sentence: str
) -> None:
    arrays: dict[str, Any] = dict.fromkeys(('q', 'dq', 'ddq', 'tau'), np.zeros((5, 2)))
    with pytest.raises(error, match=sentence):
        Dataset.from_arrays(**(arrays | changes))


def test_a_segment_of_two_recordings_is_refused() -> None:
    with pytest.raises(DataError, match=r'^a segment must be of one recording, but segment 0 is '):
        dataset(recording=[0, 0, 1, 1, 1, 1])
    with pytest.raises(ShapeError, match=r'^recording must have shape \(6,\) like q, not \(2'):
        dataset(recording=[0, 1])


def test_a_block_ends_with_a_segment_that_ends_near() -> None:
    segment = np.repeat([0, 1, 2], [95, 110, 95])
    assert contiguous_cuts(segment, 3).tolist() == [0, 95, 205, 300]
    assert contiguous_cuts(segment[:90], 3).tolist() == [0, 30, 60, 90]


@pytest.mark.parametrize('fraction', ['a', None, 1j, [0.5]])
def test_split_refuses_what_is_no_number(fraction: Any) -> None:
    with pytest.raises(DataError, match=r'^the share of a split must be a number, not '):
        dataset().split(fraction)


def source(cutoff_hz: object, **more: object) -> dict[str, Any]:
    return {'preprocessing': {'cutoff_hz': cutoff_hz}, **more}


@pytest.mark.parametrize(
    ('sources', 'expected'),
    [
        ([], {None}),
        ([source(4.0), source(6.0)], {4.0, 6.0}),
        ([source(4.0, filtered=False)], {0.0}),
        (['simulation', source(4.0)], {None, 4.0}),
        ([source('auto'), {'preprocessing': 3}, {}], {None}),
    ],
)
def test_cutoffs(sources: list[object], expected: set[float | None]) -> None:
    assert cutoffs_hz({'sources': sources}) == expected


def test_the_interval_of_samples_is_that_of_most_sources() -> None:
    sources = [{'rate_hz': 100.0, 'kept_every': every} for every in (4, 5, 9)]
    assert sample_interval_s({'sources': ['arrays', {'rate_hz': None}, *sources]}) == 0.05
    assert sample_interval_s({'sources': [{'rate_hz': 0.0, 'kept_every': 1}]}) is None
    assert sample_interval_s({}) is None


def test_no_provenance() -> None:
    assert cutoffs_hz({}) == {None}
