"""Recordings that repeat themselves."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks._families import FAMILIES, FamilyArm
from benchmarks.repetition import line, NOISE, PASSES, repeated


@pytest.mark.parametrize('drift', [0.0, 0.02])
def test_a_part_is_repeated_in_passes(drift: float) -> None:
    alone, _ = FamilyArm(next(iter(FAMILIES.values())), 0).recorded(0)
    n, std = alone.n_samples, NOISE * alone.tau.std(axis=0)
    found = repeated(alone, drift, std, 0)
    np.testing.assert_array_equal(found.q[:n], alone.q)
    np.testing.assert_array_equal(found.tau[:n], alone.tau)
    assert np.all(np.diff(found.t) > 0.0)
    for k in range(1, PASSES):
        some = slice(k * n, (k + 1) * n)
        start = round(k * drift * n)
        np.testing.assert_array_equal(found.dq[some], np.roll(alone.dq, -start, axis=0))
        noise = found.tau[some] - np.roll(alone.tau, -start, axis=0)
        np.testing.assert_allclose(noise.std(axis=0), std, rtol=0.2)
    pieces = PASSES if drift == 0.0 else 2 * PASSES - 1
    assert np.unique(found.segment).size == pieces * np.unique(alone.segment).size


def test_the_line_of_a_split() -> None:
    rows = {
        kind: {'nmse': [1.0 * k, 4.0 * k], 'unexplained': [2.0 / k]}
        for k, kind in enumerate(('alone', 'repeated', 'drifting'), start=1)
    }
    assert line('UR10, last', rows) == '| UR10, last | 2 | 4 | 6 | 2.00 | 3.00 | 0.50 | 0.33 |'
