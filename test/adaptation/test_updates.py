"""An update reads back as it was written, and what is none is refused."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

from lip_id_ros.adaptation.updates import MOST_BYTES, Update
from lip_id_ros.signals.joints import Refusal, RefusedError

FINITE = st.floats(allow_nan=False, allow_infinity=False)
GOOD = Update('a' * 64, 3, np.arange(4.0), True, (0.9, 1.1))


@given(arrays(np.float64, st.integers(0, 20), elements=FINITE), st.integers(0), FINITE)
def test_an_update_reads_back_exactly(numbers: np.ndarray, counter: int, error: float) -> None:
    update = Update('hash', counter, numbers, False, (error, 1.0))
    found = Update.from_text(update.to_text())
    np.testing.assert_array_equal(found.numbers, numbers)
    assert (found.model, found.counter, found.trusted) == ('hash', counter, False)
    assert found.errors == (error, 1.0)


@pytest.mark.parametrize(
    'text',
    [
        *('', '[]', '{}', '3', '{"schema": "lip_id_ros/update"}', '[' * 5000),
        'x' * (MOST_BYTES + 1),
    ],
)
def test_what_is_no_update_is_refused(text: str) -> None:
    with pytest.raises(RefusedError) as refused:
        Update.from_text(text)
    assert refused.value.reason is Refusal.NO_UPDATE


@pytest.mark.parametrize(
    ('key', 'value', 'reason'),
    [
        ('schema', 'other', Refusal.NO_UPDATE),
        ('counter', 1.5, Refusal.NO_UPDATE),
        ('counter', True, Refusal.NO_UPDATE),
        ('trusted', 1, Refusal.NO_UPDATE),
        ('errors', [1.0], Refusal.NO_UPDATE),
        ('numbers', [[1.0]], Refusal.NO_UPDATE),
        ('numbers', ['x'], Refusal.NO_UPDATE),
        ('numbers', [1.0, float('nan')], Refusal.NOT_FINITE_UPDATE),
        ('numbers', [float('inf')], Refusal.NOT_FINITE_UPDATE),
        ('errors', [float('nan'), 1.0], Refusal.NOT_FINITE_UPDATE),
    ],
)
def test_a_wrong_part_is_refused(key: str, value: Any, reason: Refusal) -> None:
    text = json.dumps({**json.loads(GOOD.to_text()), key: value})
    with pytest.raises(RefusedError) as refused:
        Update.from_text(text)
    assert refused.value.reason is reason


def test_an_update_that_is_worse_says_so_by_itself() -> None:
    assert not GOOD.is_worse
    assert Update('a', 1, np.zeros(1), True, (1.2, 1.1)).is_worse
    assert not Update('a', 1, np.zeros(1), False, (1.2, 1.1)).is_worse
