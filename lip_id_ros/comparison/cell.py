"""One method on one case: how long it took, how large it is, how wrong it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
import math
import time
from typing import Any

import numpy as np

from lip_id_ros.baselines import Answer, Estimator, Method
from lip_id_ros.comparison.case import Case
from lip_id_ros.comparison.code_version import code_version, UNKNOWN
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import judged
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

QUERIES = 50
QUERY_SECONDS = 1.0


@dataclass(frozen=True)
class Score:
    """
    Errors on one unseen motion.

    Attributes
    ----------
    test : str
    nmse_percent : tuple of float
        Per joint; nan where the torque does not vary.
    rmse : tuple of float
        Per joint [N m or N].
    kinetic_nmse_percent, potential_nmse_percent : float
        nan where truth or estimate is missing; the potential energy without its mean error.

    """

    test: str
    nmse_percent: tuple[float, ...]
    rmse: tuple[float, ...]
    kinetic_nmse_percent: float
    potential_nmse_percent: float

    @property
    def mean(self) -> float:
        """Mean nMSE [%] over the joints whose torque varies; nan where there is none."""
        known = [value for value in self.nmse_percent if not math.isnan(value)]
        return sum(known) / len(known) if known else math.nan


@dataclass(frozen=True)
class Cell:
    """
    What is known of one method on one case.

    Attributes
    ----------
    case, group, model : str
    n_train : int
        Samples that were there to learn from.
    joint_names : tuple of str
    fit_seconds, query_us : float
        Time of the fit [s] and of one sample's answer, median [microseconds].
    size : int
        Numbers that the model keeps in order to answer.
    scores : tuple of Score
    code : str
        Version of the code that made it.

    """

    case: str
    group: str
    model: str
    n_train: int
    joint_names: tuple[str, ...]
    fit_seconds: float
    query_us: float
    size: int
    scores: tuple[Score, ...]
    code: str = UNKNOWN

    def to_json(self) -> dict[str, Any]:
        """Return the keys of docs/interfaces.md; what is not a number becomes None."""
        content: dict[str, Any] = _without_nan(asdict(self))
        return content

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Cell:
        """Return the cell that `to_json` described."""
        scores = tuple(
            Score(
                score['test'],
                tuple(_number(value) for value in score['nmse_percent']),
                tuple(score['rmse']),
                _number(score['kinetic_nmse_percent']),
                _number(score['potential_nmse_percent']),
            )
            for score in content['scores']
        )
        joint_names = tuple(content['joint_names'])
        return cls(**{**content, 'scores': scores, 'joint_names': joint_names})


def measure(
    case: Case, model: str, method: Method, settings: FitSettings, progress: Progress
) -> tuple[Cell, Answer]:
    """
    Fit a method and judge it on every unseen motion.

    Returns
    -------
    Cell
    Answer
        On the first of the motions, to be drawn.

    Raises
    ------
    DataError
        If the data do not suffice for the method.
    FitError
        If the fit fails for numerical reasons.

    """
    started = time.perf_counter()
    estimator = method.fit(case.train, settings, progress)
    fit_seconds = time.perf_counter() - started
    answers = [estimator.predict(test.q, test.dq, test.ddq) for test in case.tests.values()]
    scores = [
        _score(name, test, answer)
        for (name, test), answer in zip(case.tests.items(), answers, strict=True)
    ]
    cell = Cell(
        case=case.name,
        group=case.group,
        model=model,
        n_train=case.train.n_samples,
        joint_names=case.train.joint_names,
        fit_seconds=fit_seconds,
        query_us=_query_us(estimator, next(iter(case.tests.values()))),
        size=estimator.size,
        scores=tuple(scores),
        code=code_version(),
    )
    return cell, answers[0]


def _score(name: str, test: Dataset, answer: Answer) -> Score:
    found = judged(test, answer.tau, answer.kinetic, answer.potential)
    energies = (found.kinetic_nmse_percent, found.potential_nmse_percent)
    return Score(name, found.nmse_percent, found.rmse, *(_number(x) for x in energies))


def _query_us(estimator: Estimator, test: Dataset) -> float:
    times: list[float] = []
    for row in range(min(QUERIES, test.n_samples)):
        one = slice(row, row + 1)
        started = time.perf_counter()
        estimator.predict(test.q[one], test.dq[one], test.ddq[one])
        times.append(time.perf_counter() - started)
        if sum(times) > QUERY_SECONDS:
            break
    return 1e6 * float(np.median(times))


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _without_nan(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_without_nan(part) for part in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def _number(value: float | None) -> float:
    return math.nan if value is None else value
