"""What makes a demonstration fail, and what does not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lip_id_ros.demo.judge import judge, verdict_table
from lip_id_ros.evaluation import Evaluation

GOOD = Evaluation(
    joint_names=('a', 'b'),
    joint_types=('revolute', 'revolute'),
    n_samples=100,
    nmse_percent=(0.1, 4.9),
    rmse=(0.1, 0.1),
    torque_std=(5.0, 1.0),
    against_truth=True,
    kinetic_nmse_percent=1.9,
    potential_nmse_percent=50.0,
    inertia_not_pd_percent=0.0,
    inertia_min_eigenvalue=0.1,
)
NOISE = (0.05, 0.05)


def failed(evaluation: Evaluation) -> list[str]:
    return [verdict.name for verdict in judge(evaluation, NOISE) if verdict.failed]


def test_small_errors_pass() -> None:
    assert failed(GOOD) == []


def test_a_large_torque_error_fails() -> None:
    assert failed(replace(GOOD, nmse_percent=(5.1, 0.1))) == ['a']


def test_a_large_error_of_the_kinetic_energy_fails() -> None:
    assert failed(replace(GOOD, kinetic_nmse_percent=2.1)) == ['kinetic energy']


@pytest.mark.parametrize('missing', [None, float('nan')])
def test_no_figure_is_no_success(missing: float | None) -> None:
    assert failed(replace(GOOD, kinetic_nmse_percent=missing)) == ['kinetic energy']
    assert failed(replace(GOOD, nmse_percent=(float('nan'), 0.1))) == ['a']


@pytest.mark.parametrize(('std', 'expected'), [(0.5, []), (0.51, ['b'])])
def test_a_torque_within_ten_times_the_noise_is_not_judged(
    std: float, expected: list[str]
) -> None:
    faint = replace(GOOD, nmse_percent=(0.1, 80.0), torque_std=(5.0, std))

    assert failed(faint) == expected
    assert judge(faint, NOISE)[1].judged is bool(expected)


def test_table_says_what_is_wrong() -> None:
    faint = replace(GOOD, nmse_percent=(7.0, 80.0), torque_std=(5.0, 0.1))
    rows = {row[0]: row[-1] for row in verdict_table(judge(faint, NOISE)).rows}

    assert rows == {
        'a': 'TOO LARGE',
        'b': 'not judged: close to the noise',
        'kinetic energy': 'ok',
    }
