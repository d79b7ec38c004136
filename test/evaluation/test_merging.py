"""Errors on parts make those on the whole."""

from __future__ import annotations

from dataclasses import replace
import math

from evaluation.stubs import Knowing
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.evaluation import evaluate
from lip_id_ros.evaluation.merging import merged

DATA = replace(swing(2, duration=5.0), tau_noiseless=None, kinetic=None, potential=None)
MODEL = Knowing(torque_error=0.3, inertia=np.array([1.0, -1e-3, 2.0]))


@given(st.lists(st.integers(1, DATA.n_samples - 1), min_size=1, max_size=4, unique=True))
def test_errors_of_parts_are_those_of_the_joined_samples(cuts: list[int]) -> None:
    parts = np.split(np.arange(DATA.n_samples), sorted(cuts))
    found = merged([evaluate(MODEL, DATA.select(rows)) for rows in parts])
    whole = evaluate(MODEL, DATA)
    for name in ('nmse_percent', 'rmse', 'torque_mean', 'torque_std'):
        np.testing.assert_allclose(getattr(found, name), getattr(whole, name), rtol=1e-9)
    assert found.n_samples == whole.n_samples
    assert found.inertia_not_pd_percent == pytest.approx(100.0)
    assert found.inertia_min_eigenvalue == whole.inertia_min_eigenvalue == -1e-3


def test_one_evaluation_stays_as_it_is() -> None:
    only = evaluate(MODEL, swing(2))
    assert merged([only]) is only


def test_what_does_not_add_up_is_left_out_and_cautions_are_given_once() -> None:
    one = replace(evaluate(MODEL, swing(2)), cautions=('Beware.',))
    other = replace(one, within_two_std_percent=(90.0,) * 3, cautions=('Beware.', 'Careful.'))
    found = merged([one, other])
    assert one.kinetic_nmse_percent is not None
    assert found.kinetic_nmse_percent is None
    assert found.within_two_std_percent is None
    assert found.cautions == ('Beware.', 'Careful.')


def test_a_constant_torque_has_no_share() -> None:
    still = np.array(DATA.tau)
    still[:, 1] = 2.0
    some = evaluate(MODEL, replace(DATA, tau=still))
    found = merged([some, some])
    assert math.isnan(found.nmse_percent[1])
    assert found.nmse_percent[0] == pytest.approx(some.nmse_percent[0])


def test_the_coverage_is_that_of_all_samples_where_each_part_has_one() -> None:
    one = replace(evaluate(MODEL, DATA.select(range(30))), within_two_std_percent=(90.0,) * 3)
    other = replace(evaluate(MODEL, DATA.select(range(10))), within_two_std_percent=(50.0,) * 3)
    assert merged([one, other]).within_two_std_percent == (80.0,) * 3
