"""The work of a fit is bounded for any torques (docs/explanation/maths.md, sections 10 and 13)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from gp.arms import dataset_of
from gp.chains import R, random_arm
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.identification import (
    arm_fit,
    coupling_search,
    geometry_selection,
    placement_search,
)
from lip_id_ros.identification.arm_problem import ArmProblem
from lip_id_ros.identification.identify import identify
from lip_id_ros.identification.kinematic_calibration import PlacementProblem


def most_of_placements() -> int:
    """
    Both searches to their last batch, without springs, with them probed, and with them.

    Refinements of few and of all samples are done after each of the three, and once more without
    outliers. Couplings of two joints are tried, judged and searched with, one after the other.

    """
    search = placement_search
    descents = search.SEARCHES * (search.STARTS + search.MOST_BATCHES * search.ROUNDS)
    # one more evaluation a round, for its noise
    refined = (search.CANDIDATES + search.FINALISTS) * search.MORE_EVALUATIONS + 2
    couplings = coupling_search
    trials = len(couplings.FIRST_RATIOS) + len(couplings.RATIOS) + 1
    tried = trials * couplings.MINIMA * couplings.EVALUATIONS
    judged = 2 * couplings.FOLDS * search.MORE_EVALUATIONS + search.REFINEMENTS * 2 * refined
    of_couplings = couplings.MOST * (tried + judged + descents * search.EVALUATIONS)
    return 2 * descents * search.EVALUATIONS + search.REFINEMENTS * 4 * refined + of_couplings


def most_of_arms() -> int:
    """All starts, every trial of a geometry, and every round of the last descent."""
    starts = placement_search.CANDIDATES * len(arm_fit.LIFTS) * sum(arm_fit.FIRST_ROUND)
    kept = arm_fit.KEPT * sum(arm_fit.LAST_ROUNDS)
    tried = (1 + len(arm_fit.LIFTS)) * sum(arm_fit.FIRST_ROUND) + sum(geometry_selection.ROUNDS)
    trials = geometry_selection.MOST_TRIALS * tried
    return (
        starts
        + kept
        + trials
        + sum(arm_fit.EVALUATIONS)
        + arm_fit.MOST_ROUNDS * sum(arm_fit.ROUND)
    )


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Evaluations of the cost of placements, and of that of arms."""
    found: Counter[str] = Counter()

    def counting(name: str, method: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*arguments: Any) -> Any:
            found[name] += 1
            return method(*arguments)

        return counted

    for problem, method in ((PlacementProblem, 'at'), (ArmProblem, 'evaluated')):
        counted = counting(problem.__name__, getattr(problem, method))
        monkeypatch.setattr(problem, method, counted)
    return found


def torques_of_no_arm(kind: str) -> Dataset:
    arm = random_arm((R, R), seed=3)
    q, dq, ddq = arm.motion(150, seed=0)
    tau = {
        'noise': np.random.default_rng(2).standard_normal(q.shape),
        'steps': np.sign(np.sin(20.0 * q)),
        'squares': ddq**2 * q[:, ::-1],
    }[kind]
    return dataset_of(arm, (q, dq, ddq), tau)


@pytest.mark.slow
@pytest.mark.parametrize('kind', ['steps', 'squares'])
def test_torques_that_no_arm_makes_take_a_bounded_number_of_evaluations(
    counts: Counter[str], kind: str
) -> None:
    identify(torques_of_no_arm(kind))
    assert 0 < counts['PlacementProblem'] <= most_of_placements()
    assert 0 < counts['ArmProblem'] <= most_of_arms()


@pytest.mark.slow
def test_the_bound_holds_where_nothing_agrees_and_nothing_converges(
    counts: Counter[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(placement_search, 'SAME', -1.0)
    # the likelihood speaks against whatever is imposed, and left-out blocks agree
    monkeypatch.setattr(geometry_selection, 'LEAST_ERRORS', -np.inf)
    monkeypatch.setattr(arm_fit, 'LEAST_GAIN', -np.inf)
    found = identify(torques_of_no_arm('noise'))
    search = placement_search
    assert not found.searches_agreed
    assert found.descents == search.SEARCHES * (
        search.STARTS + search.MOST_BATCHES * search.ROUNDS
    )
    assert 0 < counts['PlacementProblem'] <= most_of_placements()
    assert 0 < counts['ArmProblem'] <= most_of_arms()
