"""Medians over three unseen motions, whose medians are no means."""

from __future__ import annotations

from dataclasses import replace
import math

import pytest

from benchmarks.comparison import Cell, Results, Score
from benchmarks.comparison.run import tables, to_json


def cell(model: str, factor: float, **cost: float) -> Cell:
    """Three motions of two joints; of the second joint, one motion has no torque."""
    scores = tuple(
        Score(name, (factor * a, factor * b), (a, 2.0 * a), kinetic, math.nan)
        for name, a, b, kinetic in (
            ('one', 1.0, 3.0, 5.0),
            ('two', 10.0, 2.0, 50.0),
            ('three', 2.0, 30.0, 6.0),
        )
    )
    figures = {'fit_seconds': 1.0, 'query_us': 2.0, 'size': 3, **cost}
    return Cell('case', 'group', model, 7, ('a', 'b'), scores=scores, **figures)  # type: ignore[arg-type]


def test_figures_of_a_group_are_medians() -> None:
    found = to_json(Results((cell('x', 1.0), cell('y', 2.0)), (), ()))['groups']['group']
    assert found['x']['nmse_percent'] == [2.0, 3.0]
    assert found['y']['nmse_percent'] == [4.0, 6.0]
    assert found['x']['nmse_percent_mean'] == 6.0  # of 2, 6 and 16
    assert found['x']['global_mse'] == 20.0  # of 5, 500 and 20: sums of squares, not of values
    assert found['x']['kinetic_nmse_percent'] == 6.0
    assert found['x']['potential_nmse_percent'] is None
    assert found['x']['motions'] == 3


def test_costs_of_several_cases_are_medians() -> None:
    cells = tuple(
        cell('x', 1.0, fit_seconds=seconds, query_us=query, size=size)
        for seconds, query, size in ((1.0, 30.0, 5), (9.0, 10.0, 50), (2.0, 20.0, 7))
    )
    found = to_json(Results(cells, (), ()))['groups']['group']['x']
    assert (found['fit_seconds'], found['query_us'], found['size']) == (2.0, 20.0, 7.0)
    assert found['motions'] == 9
    errors, costs = tables(Results(cells, (), ()))
    assert errors.rows == [('x', '2', '3', '6', '6')]
    assert costs.rows == [('x', '2', '20', '7')]
    assert 'median of 9 unseen motions' in errors.title


def test_a_joint_without_torque_is_left_out_of_a_mean() -> None:
    assert Score('a', (4.0, math.nan), (1.0, 1.0), 0.0, 0.0).mean == pytest.approx(4.0)
    assert math.isnan(Score('a', (math.nan,), (1.0,), 0.0, 0.0).mean)


def test_errors_near_rest_have_a_table_where_they_are_known() -> None:
    known = [
        replace(score, in_motion=(1.0 + k, 0.5), near_rest=(math.nan if k else 7.0, math.nan))
        for k, score in enumerate(cell('x', 1.0).scores)
    ]
    one = replace(cell('x', 1.0), scores=tuple(known))
    assert Cell.from_json(one.to_json()).to_json() == one.to_json()
    _, rest, _ = tables(Results((one,), (), ()))
    assert rest.rows == [('x', '2, 7', '0.5, none')]
