"""What the inertia matrix and the potential may depend on, and what is not promised of them."""

from __future__ import annotations

from gp.processes import process_of
from kernels.cases import MEMBERS
from kernels.test_family import degree
from model.models import random_model
import numpy as np
import pytest

from lip_id_ros.arrays import Array

TYPES = ('revolute',) * 4
TURN = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)


def turned(joint: int) -> Array:
    """Return positions in which one joint goes round and the others stay."""
    q = np.tile(np.random.default_rng(2).normal(size=4), (len(TURN), 1))
    q[:, joint] = TURN
    return q


def harmonics(values: Array) -> Array:
    """Return the sizes of the harmonics of one turn, along the first index."""
    return np.abs(np.fft.rfft(values, axis=0)) / len(TURN)


@pytest.mark.parametrize('joint', range(4))
@pytest.mark.parametrize('member', MEMBERS)
def test_degree_of_every_entry(member: str, joint: int) -> None:
    """An entry has the harmonics up to its degree, which is zero for the joints before it."""
    matrix = random_model(member, TYPES, friction=False).inertia_matrix(turned(joint))
    size = abs(matrix).max()
    for j, k in np.ndindex(4, 4):
        found = harmonics(matrix[:, j, k]) / size
        top = degree(member, j, k, joint)
        assert (found[top + 1 :] < 1e-12).all(), (j, k)
        assert found[top] > 1e-6, (j, k)


@pytest.mark.parametrize('joint', range(4))
@pytest.mark.parametrize('member', MEMBERS)
def test_degree_of_the_potential(member: str, joint: int) -> None:
    """A body's height is linear in the sine and cosine of every joint before it."""
    q = turned(joint)
    still = np.zeros_like(q)
    potential = random_model(member, TYPES, friction=False).predict(q, still, still).potential
    assert potential is not None
    found = harmonics(potential) / abs(potential).max()
    assert (found[2:] < 1e-12).all()
    assert found[1] > 1e-6


@pytest.mark.parametrize('member', MEMBERS)
def test_positive_definiteness_is_not_promised(member: str) -> None:
    """From torques that no arm can have, an inertia matrix that no arm can have is learned."""
    model = random_model(member, friction=False)
    eigenvalues = np.linalg.eigvalsh(model.inertia_matrix(process_of(model).states.q))
    assert eigenvalues.min() < 0.0
