"""Statistics of samples that come chunk by chunk, against those of all rows at once."""

from __future__ import annotations

from dataclasses import replace

from fleet.fleets import arm_of, friction_of, linearisation_of, recording
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.friction.terms import load_coulomb
from lip_id_ros.identification import factor_sum
from lip_id_ros.identification.factor_sum import Gathering, statistics_of
from lip_id_ros.identification.joint_rows import JointRows
from lip_id_ros.identification.linearisation import Linearisation, Samples
from lip_id_ros.identification.statistics import TorqueStatistics

COUNT = 3000


def around_of(count: int = COUNT) -> tuple[Dataset, Linearisation]:
    """Return a recording, and a linearisation with loaded friction and more noise near rest."""
    arm = arm_of(1, ('revolute', 'prismatic', 'revolute'))
    friction = friction_of(arm, np.random.default_rng(0), 0.1)
    data = recording(arm, friction, seed=1, count=count)
    around = linearisation_of(arm, data)
    noise = TorqueNoise(around.noise.std, np.linspace(0.5, 2.0, 3), np.full(3, 0.1))
    basis, coefficients = around.friction.basis, np.append(around.friction.coefficients, 0.1)
    loaded = DriveTerm(Drive.of_joint(1), load_coulomb(0.05))
    model = FrictionModel(replace(basis, terms=(*basis.terms, loaded)), coefficients)
    return data, replace(around, noise=noise, friction=model)


def plain(data: Dataset, around: Linearisation) -> TorqueStatistics:
    """Return the statistics of all rows, by orthogonal transformations."""
    empty = TorqueStatistics.empty([np.concatenate(own) for own in around.columns])
    features, target = around.rows(data)
    return empty.update(features, target, around.noise.weights(data.dq))


def assert_same(found: TorqueStatistics, expected: TorqueStatistics) -> None:
    assert_array_equal(found.counts, expected.counts)
    for one, other in zip(found.factors, expected.factors, strict=True):
        size = np.maximum(np.linalg.norm(other, axis=0), 1e-300)
        assert_allclose(
            (one / size).T @ (one / size), (other / size).T @ (other / size), atol=1e-11
        )


@pytest.mark.parametrize('count', [0, 1, 399, 401, 1200, COUNT])
def test_any_number_of_samples_has_the_statistics_of_their_rows(count: int) -> None:
    data, around = around_of()
    rows = np.random.default_rng(0).permutation(COUNT)[:count]
    rows.sort()
    found = statistics_of(data, rows, around)
    if count:
        assert_same(found, plain(data.select(rows), around))
    assert_array_equal(found.counts, count)


def test_chunks_are_few_rows_and_the_first_is_of_the_whole_recording(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An arm that rests at first would show a metric nothing of its motion."""
    chunks: list[Samples] = []
    add = Gathering.add

    def kept(self: Gathering, samples: Samples) -> None:
        chunks.append(samples)
        add(self, samples)

    monkeypatch.setattr(Gathering, 'add', kept)
    data, around = around_of()
    statistics_of(data, np.arange(COUNT), around)
    sizes = [len(each.q) for each in chunks]
    assert max(sizes) <= factor_sum.CHUNK
    assert sum(sizes) == COUNT
    places = np.flatnonzero(np.isin(data.q[:, 0], chunks[0].q[:, 0]))
    assert places[0] < 10
    assert places[-1] > COUNT - 10


def test_rows_of_a_joint_are_those_of_the_linearisation() -> None:
    data, around = around_of(100)
    features, target = around.rows(data)
    root = np.sqrt(around.noise.weights(data.dq))
    parts, _ = around.parts(Samples.of(data))
    check = np.random.default_rng(0).standard_normal(200)
    for joint, own in enumerate(around.columns):
        column = np.concatenate(own)
        rows = JointRows(parts, joint, column, target, root)
        expected = np.column_stack([features[joint], target[:, joint]]) * root[:, joint, None]
        assert_array_equal(rows.all(), expected)
        some, size = np.array([0, 2, 7, column.size]), column.size + 1
        found, products = rows.some(some, check[:size])
        assert_array_equal(found, expected[:, some])
        assert found.flags.f_contiguous
        assert_allclose(products, expected @ check[:size], rtol=1e-12, atol=1e-12)
