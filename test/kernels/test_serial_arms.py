"""What docs/explanation/maths.md says of every serial arm, held by arms put together at random."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from kernels.serial_arm import SerialArm
from kernels.test_family import degree
import numpy as np
import pytest

from lip_id_ros.arrays import Array

R, P = 'revolute', 'prismatic'
ARMS = ((R, R, R, R), (P, R, R, P), (R, P, R, R), (R, R, P, P))
TURN = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)


def degrees(kind: str, values: Array) -> Array:
    """Return the degree of values, shape (12, ...), taken while one joint goes through TURN."""
    scale = max(abs(values).max(), 1.0)
    if kind == R:
        sizes = np.abs(np.fft.rfft(values, axis=0)) / len(TURN)
    else:
        columns = values.reshape(len(TURN), -1)
        sizes = np.abs(np.polynomial.chebyshev.chebfit(TURN / np.pi - 1.0, columns, 6))
        sizes = sizes.reshape(7, *values.shape[1:])
    found = sizes > 1e-9 * scale
    return np.where(found.any(axis=0), len(found) - 1 - np.argmax(found[::-1], axis=0), 0)


def moved(arm: SerialArm, joint: int, function: Callable[[Array], object]) -> Array:
    """Return a function's values while one joint moves."""
    q = np.random.default_rng(5).normal(size=len(arm.types))
    return np.array([function(np.where(np.arange(len(q)) == joint, x, q)) for x in TURN])


@pytest.mark.parametrize('types', ARMS)
def test_inertia_of_every_link(types: tuple[str, ...]) -> None:
    """No entry has a higher degree than the recursive kernel allows, and some have that one."""
    arm, reached = SerialArm(types), set()
    for link in range(4):
        for joint in range(link + 1):
            matrices = moved(arm, joint, partial(arm.link_inertia, link))
            found = degrees(types[joint], matrices)
            for j, k in np.ndindex(link + 1, link + 1):
                allowed = degree('recursive', j, k, joint)
                assert found[j, k] <= allowed, (link, joint, j, k)
                assert allowed <= degree('lip', j, k, joint)
                reached.add((allowed, int(found[j, k])))
    assert {(0, 0), (1, 1), (2, 2)} <= reached


@pytest.mark.parametrize('types', ARMS)
def test_height_of_every_link(types: tuple[str, ...]) -> None:
    """The potential energy is linear in the features of every joint up to the link."""
    arm = SerialArm(types)
    for link in range(4):
        for joint in range(4):
            heights = moved(arm, joint, partial(arm.height, link))
            assert degrees(types[joint], heights) <= (joint <= link)
