"""Cut-offs from the provenance of a data set."""

from __future__ import annotations

from typing import Any

import pytest

from lip_id_ros.dataset import cutoffs_hz


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


def test_no_provenance() -> None:
    assert cutoffs_hz({}) == {None}
