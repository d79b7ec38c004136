"""One cell of a comparison: the errors and the cost of one method on one case."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
import hashlib
from importlib.metadata import PackageNotFoundError, version
import math
import os
from pathlib import Path
import time
from typing import Any

import numpy as np

from benchmarks.baselines import Method
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import Outcome, score
from lip_id_ros.evaluation.metrics import mean_of_known
from lip_id_ros.model import TorqueModel, TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

QUERIES = 50
QUERY_SECONDS = 1.0
BENCHMARKS = Path(__file__).resolve().parents[1]
PACKAGE = BENCHMARKS.with_name('lip_id_ros')
PARTS = (
    *(BENCHMARKS / 'baselines', BENCHMARKS / 'comparison/cell.py'),
    *(PACKAGE / each for each in ('arrays.py', 'joint_types.py', 'linear_algebra.py')),
    *(PACKAGE / each for each in ('joint_history.py', 'numba_jit.py', 'dataset', 'description')),
    *(PACKAGE / each for each in ('friction', 'gp')),
    *(PACKAGE / each for each in ('identification', 'kernels', 'model', 'rigid_body')),
    *(
        PACKAGE / each
        for each in ('settings', 'evaluation/metrics.py', 'evaluation/prediction.py')
    ),
)
UNKNOWN = 'unknown'


@dataclass(frozen=True)
class Case:
    """
    One training set and the motions on which its models are evaluated.

    Attributes
    ----------
    name : str
        Unique among the cases that are compared together.
    group : str
        Cases of one group make one table and one box plot.
    tests : mapping from str to Dataset
        Unseen motions by name, with the joints of `train` in its order.
    urdf : path, optional
        Robot description, for methods that need one.

    """

    name: str
    group: str
    train: Dataset
    tests: Mapping[str, Dataset]
    urdf: str | os.PathLike[str] | None = None

    def fingerprint(self) -> str:
        """Return a digest of the data, their names and the URDF."""
        data = [each.digest() for each in (self.train, *self.tests.values())]
        digest = hashlib.sha256(repr((self.name, self.group, list(self.tests), data)).encode())
        if self.urdf is not None:
            with open(self.urdf, 'rb') as file:
                digest.update(file.read())
        return digest.hexdigest()


def thinned(dataset: Dataset, count: int) -> Dataset:
    """Return `count` evenly spaced samples, or all where there are fewer."""
    if count >= dataset.n_samples:
        return dataset
    return dataset.select(np.linspace(0, dataset.n_samples - 1, count).round().astype(np.int64))


@dataclass(frozen=True)
class Score:
    """
    Errors on one unseen motion; `nmse_percent` and `rmse` [N m or N] per joint.

    `in_motion` and `near_rest` are root mean squares of the samples at which a joint moves, or
    hardly does; empty in results of older code. nan where a torque does not vary, there are no
    such samples, or the truth or the estimate of an energy is missing. The potential energy is
    compared without its mean error.

    """

    test: str
    nmse_percent: tuple[float, ...]
    rmse: tuple[float, ...]
    kinetic_nmse_percent: float
    potential_nmse_percent: float
    in_motion: tuple[float, ...] = ()
    near_rest: tuple[float, ...] = ()

    @property
    def mean(self) -> float:
        """Mean nMSE [%] over the joints whose torque varies; nan where there is none."""
        return mean_of_known(self.nmse_percent)


@dataclass(frozen=True)
class Cell:
    """
    Errors and cost of one method on one case.

    `fit_seconds` and `query_us` are times of the fit [s] and of the prediction of one sample,
    median [microseconds]; `size` is how many numbers the model keeps, `code` the version of the
    code.

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
        """Return the fields by name; nan becomes None."""
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
                *(tuple(map(_number, score.get(name, ()))) for name in ('in_motion', 'near_rest')),
            )
            for score in content['scores']
        )
        joint_names = tuple(content['joint_names'])
        return cls(**{**content, 'scores': scores, 'joint_names': joint_names})


def measure(
    case: Case, model: str, method: Method, settings: FitSettings, progress: Progress
) -> tuple[Cell, TorquePrediction]:
    """
    Fit a method and evaluate it on every unseen motion; also return its prediction on the first.

    Raises
    ------
    DataError
        If the data do not suffice for the method.
    FitError
        If the fit fails for numerical reasons.

    """
    started = time.perf_counter()
    fitted = method.fit(case.train, settings, progress)
    fit_seconds = time.perf_counter() - started
    predictions = [fitted.predict(test.q, test.dq, test.ddq) for test in case.tests.values()]
    scores = [
        _score(name, Outcome(test, prediction))
        for (name, test), prediction in zip(case.tests.items(), predictions, strict=True)
    ]
    cell = Cell(
        case=case.name,
        group=case.group,
        model=model,
        n_train=case.train.n_samples,
        joint_names=case.train.joint_names,
        fit_seconds=fit_seconds,
        query_us=_query_us(fitted, next(iter(case.tests.values()))),
        size=fitted.size,
        scores=tuple(scores),
        code=code_version(),
    )
    return cell, predictions[0]


def _score(name: str, outcome: Outcome) -> Score:
    found = score(outcome)
    return Score(
        name,
        found.nmse_percent,
        found.rmse,
        _number(found.kinetic_nmse_percent),
        _number(found.potential_nmse_percent),
        () if found.rest is None else found.rest.in_motion,
        () if found.rest is None else found.rest.near_rest,
    )


def _query_us(model: TorqueModel, test: Dataset) -> float:
    times: list[float] = []
    for row in range(min(QUERIES, test.n_samples)):
        one = slice(row, row + 1)
        started = time.perf_counter()
        model.predict(test.q[one], test.dq[one], test.ddq[one])
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


@cache
def code_version() -> str:
    """Return the version of the package and a digest of `PARTS`, which fit and evaluate."""
    try:
        known = version(PACKAGE.name)
    except PackageNotFoundError:  # sources on the path, not installed
        known = UNKNOWN
    return f'{known}-{source_digest(PARTS)}'


def source_digest(places: Iterable[Path]) -> str:
    """Return eight hexadecimal digits of the Python sources in some folders, or files."""
    digest = hashlib.sha256()
    for place in places:
        for path in [place] if place.is_file() else sorted(place.rglob('*.py')):
            digest.update(path.relative_to(place.parent).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:8]
