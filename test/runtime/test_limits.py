"""Limits: whatever the model says, what leaves is finite and within them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
from numpy.typing import NDArray
import pytest

from lip_id_ros.errors import ConfigError
from lip_id_ros.runtime.limits import limits_by_name, TorqueLimits
from lip_id_ros.runtime.references import RefusedError

LIMITS = (87.0, 12.0, 0.0)


@given(
    arrays(np.float64, (4, 3), elements=st.floats(allow_nan=False, allow_infinity=False)),
    st.floats(0.0, 1.0),
)
def test_nothing_leaves_beyond_its_limit(tau: NDArray[np.float64], scale: float) -> None:
    limits = TorqueLimits(LIMITS, scale)
    safe = limits.apply(tau)
    assert (np.abs(safe) <= LIMITS).all()
    within = (np.abs(scale * tau) <= LIMITS).all(axis=1)
    np.testing.assert_array_equal(safe[within], scale * tau[within])
    assert limits.limited == np.count_nonzero(~within)


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_torque_that_is_not_finite_is_refused(value: float) -> None:
    tau = np.array([1.0, value, 0.0])
    with pytest.raises(RefusedError, match=r'gave a torque that is not finite'):
        TorqueLimits(LIMITS, 1.0).apply(tau)


def test_no_limits_leave_torques_as_they_are() -> None:
    limits = limits_by_name((), (), ('a', 'b'))
    np.testing.assert_array_equal(TorqueLimits(limits, 1.0).apply(np.array([1e9, -3])), [1e9, -3])


def test_limits_follow_their_joints() -> None:
    assert limits_by_name((1.0, 2.0), ('b', 'a'), ('a', 'b')) == [2.0, 1.0]
    assert limits_by_name((1.0, 2.0), (), ('a', 'b')) == [1.0, 2.0]
    assert limits_by_name((3.0,), (), ('a', 'b')) == [3.0, 3.0]


def test_wrong_number_of_limits_gives_one_sentence() -> None:
    with pytest.raises(ConfigError, match=r'one limit per joint \(3\).*holds 2: .* of a, b, c\.$'):
        limits_by_name((1.0, 2.0), (), ('a', 'b', 'c'))
