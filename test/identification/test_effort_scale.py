"""What scales of efforts explain."""

from __future__ import annotations

import numpy as np
import pytest

from lip_id_ros.identification.effort_scale import EffortScale

ONES = np.ones(4)


@pytest.mark.parametrize(
    ('residual', 'explains'),
    [
        ([0.03, 0.03, 0.03, 0.03], True),
        ([0.01, 0.01, 0.01, 0.15], True),
        ([0.1, 0.1, 0.1, 0.1], False),
        ([0.01, 0.01, 0.01, 0.5], False),
    ],
)
def test_efforts_are_explained_where_all_and_each_are(
    residual: list[float], *, explains: bool
) -> None:
    scale = EffortScale(ONES, np.array(residual), 0.1 * ONES, ONES, ONES)
    assert scale.explains == explains
