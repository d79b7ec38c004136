"""Run a comparison: every method on every case; medians of the errors as tables and JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
import hashlib
from itertools import product
import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.baselines import Method, method
from benchmarks.baselines.registry import MEANINGS
from benchmarks.comparison.cell import Case, Cell, code_version, measure, Score
from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError, FitError
from lip_id_ros.evaluation.tables import percent, Table
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.model import TorquePrediction
from lip_id_ros.model.proof import is_useless, known_errors
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import FitSettings

CELLS, THIS_FIT = 'models', 'this fit'
VERSION = 1  # of a cell's file
ENERGIES = ('kinetic', 'potential')
COST = ('model', 'fit [s]', 'one query [us]', 'numbers kept')

Make = Callable[[str, Case], Method]


class Store:
    """
    A folder with one file per cell, made where it does not exist; OSError if that fails.

    Data, model and settings identify a cell.

    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)

    def path(self, case: Case, model: str, settings: FitSettings) -> Path:
        """Return the file of a cell, which need not exist yet."""
        key = json.dumps([VERSION, case.fingerprint(), model, asdict(settings)], sort_keys=True)
        return self._folder / f'{model}-{hashlib.sha256(key.encode()).hexdigest()[:16]}.npz'

    def save(self, path: Path, cell: Cell, prediction: TorquePrediction) -> None:
        """Keep a cell, and the prediction on the first motion; OSError if it cannot be written."""
        arrays = {'tau': prediction.tau}
        arrays |= {name: x for name in ENERGIES if (x := getattr(prediction, name)) is not None}
        write_npz(path, arrays, {'cell': cell.to_json()})

    def load(self, path: Path) -> Cell | None:
        """Return a kept cell; None where there is none, or only a damaged one."""
        try:
            return Cell.from_json(read_npz(path)[1]['cell'])
        except (FileNotFoundError, ValueError, KeyError):
            return None

    def prediction(self, path: Path) -> TorquePrediction:
        """Return the prediction on the first motion; OSError if the cell cannot be read."""
        arrays: dict[str, Array] = read_npz(path)[0]
        return TorquePrediction(arrays['tau'], arrays.get('kinetic'), arrays.get('potential'))


@dataclass(frozen=True)
class Results:
    """
    Results of a comparison.

    Attributes
    ----------
    cells : tuple of Cell
        In the order of cases, then of models.
    paths : tuple of Path
        Their files.
    failures : tuple of str
        Sentences: which fits failed, and why. They are tried again next time.

    """

    cells: tuple[Cell, ...]
    paths: tuple[Path, ...]
    failures: tuple[str, ...]


def compare(
    cases: Sequence[Case],
    models: Sequence[str],
    settings: FitSettings,
    store: Store,
    progress: Progress = silent,
    make: Make | None = None,
) -> Results:
    """
    Fit and evaluate every model on every case, with the same settings.

    Parameters
    ----------
    models : sequence of str
        Names of `benchmarks.baselines.MODELS`.
    store : Store
        Holds the finished cells.
    make : callable, optional
        Makes the method of a name for a case; `benchmarks.baselines.method` by default.

    Raises
    ------
    ConfigError
        If there is no such model, or one needs a URDF that a case has not.
    LipIdError
        If a package is missing.
    OSError
        If a cell cannot be written.

    """
    make = make or (lambda name, case: method(name, case.urdf))
    for case, model in product(cases, models):
        make(model, case)  # fails before the work where something is missing
    cells, paths, failures = [], [], []
    todo = list(product(cases, models))
    for number, (case, model) in enumerate(todo):
        progress(CELLS, number, len(todo))
        path = store.path(case, model, settings)
        cell = store.load(path)
        if cell is None:
            try:
                cell, prediction = measure(
                    case, model, make(model, case), settings, _inner(progress)
                )
            except (DataError, FitError) as error:
                failures.append(f'{model} on {case.name}: {error}')
                continue
            store.save(path, cell, prediction)
        cells.append(cell)
        paths.append(path)
    progress(CELLS, len(todo), len(todo))
    return Results(tuple(cells), tuple(paths), tuple(failures))


def _inner(progress: Progress) -> Progress:
    return lambda _, done, total: progress(THIS_FIT, done, total)


def groups(cells: Sequence[Cell]) -> dict[str, dict[str, list[Cell]]]:
    """Return the cells by group, then by model, in their order."""
    found: dict[str, dict[str, list[Cell]]] = {}
    for cell in cells:
        found.setdefault(cell.group, {}).setdefault(cell.model, []).append(cell)
    return found


def joint_errors(cells: Sequence[Cell]) -> Array:
    """Return the nMSE [%] of every unseen motion and joint, shape (motions, n)."""
    return np.array([score.nmse_percent for cell in cells for score in cell.scores])


def mean_errors(cells: Sequence[Cell]) -> Array:
    """Return the nMSE [%] of every unseen motion, mean over the joints, shape (motions,)."""
    return np.array([score.mean for cell in cells for score in cell.scores])


def tables(results: Results) -> Iterator[Table]:
    """Yield the tables of every group: errors, also near rest, then the cost of the models."""
    for group, by_model in groups(results.cells).items():
        yield _errors(group, by_model)
        scores = {m: [x for each in cells for x in each.scores] for m, cells in by_model.items()}
        if all(score.near_rest for some in scores.values() for score in some):
            yield _rest_errors(group, next(iter(by_model.values()))[0].joint_names, scores)
        yield Table(f'{group}: cost, medians', COST, [_cost(*item) for item in by_model.items()])


def meanings(cells: Sequence[Cell]) -> dict[str, str]:
    """Return the description of each model, by its name, where there is one."""
    return {cell.model: MEANINGS[cell.model] for cell in cells if cell.model in MEANINGS}


def remarks(results: Results) -> list[str]:
    """Return the failures, the models that explain nothing of a joint, and results of old code."""
    codes = (cell.code for cell in results.cells)
    useless = _hardly_better_than_mean(results.cells)
    return [*results.failures, *useless, *_made_by_others(codes, code_version())]


def to_json(results: Results) -> dict[str, Any]:
    """Return all cells and their medians."""
    return {
        'groups': {
            group: {model: _medians(cells) for model, cells in by_model.items()}
            for group, by_model in groups(results.cells).items()
        },
        'cells': [cell.to_json() for cell in results.cells],
        'failures': list(results.failures),
    }


def _hardly_better_than_mean(cells: Sequence[Cell]) -> Iterator[str]:
    """Yield a sentence for each group with models that predict a joint as its mean would."""
    for group, by_model in groups(cells).items():
        found = {
            model: known_errors(_medians(some)['nmse_percent']) for model, some in by_model.items()
        }
        names = {
            model: [
                name
                for name, error in zip(by_model[model][0].joint_names, errors, strict=True)
                if is_useless(error)
            ]
            for model, errors in found.items()
        }
        if listed := [
            f'{model} at {", ".join(joints)}' for model, joints in names.items() if joints
        ]:
            yield f'{group}: hardly better than the mean of the torque: {"; ".join(listed)}.'


def _made_by_others(codes: Iterable[str], here: str) -> list[str]:
    """Return a warning where results were made by other code than that of the version `here`."""
    all_codes = list(codes)
    others = sorted({code for code in all_codes if code != here})
    if not others:
        return []
    count = sum(code != here for code in all_codes)
    return [
        f'{count} of {len(all_codes)} results were kept from other code ({", ".join(others)}; '
        f'this is {here}); for results of this code compare into a new folder.'
    ]


def _errors(group: str, by_model: dict[str, list[Cell]]) -> Table:
    joints = next(iter(by_model.values()))[0].joint_names
    medians = {model: _medians(cells) for model, cells in by_model.items()}
    energies = [
        name
        for name in ('kinetic', 'potential')
        if any(found[f'{name}_nmse_percent'] is not None for found in medians.values())
    ]
    header = ('model', *joints, 'mean', *energies)
    rows = []
    for model, found in medians.items():
        figures = [*found['nmse_percent'], found['nmse_percent_mean']]
        figures += [found[f'{name}_nmse_percent'] for name in energies]
        rows.append((model, *(percent(x) for x in figures)))
    count = max(len(joint_errors(cells)) for cells in by_model.values())
    motions = 'one unseen motion' if count == 1 else f'median of {count} unseen motions'
    return Table(f'{group}: nMSE [%], {motions}', header, rows)


def _rest_errors(
    group: str, joints: Sequence[str], scores: Mapping[str, Sequence[Score]]
) -> Table:
    rows = []
    for model, some in scores.items():
        motion = zip(*(each.in_motion for each in some), strict=True)
        rest = zip(*(each.near_rest for each in some), strict=True)
        pairs = zip(map(_known, motion), map(_known, rest), strict=True)
        rows.append((model, *(', '.join(pair) for pair in pairs)))
    title = f'{group}: RMSE in motion, near rest [N m or N], medians'
    return Table(title, ('model', *joints), rows)


def _known(values: Iterable[float]) -> str:
    """Return the median of the values that are numbers, as text."""
    numbers = [value for value in values if not math.isnan(value)]
    return f'{np.median(numbers):.3g}' if numbers else 'none'


def _cost(model: str, cells: Sequence[Cell]) -> tuple[str, ...]:
    found = _medians(cells)
    seconds, query = found['fit_seconds'], found['query_us']
    return model, f'{seconds:.3g}', f'{query:.0f}', f'{found["size"]:.0f}'


def _medians(cells: Sequence[Cell]) -> dict[str, Any]:
    scores = [score for cell in cells for score in cell.scores]
    return {
        'motions': len(scores),
        'nmse_percent': [_number(x) for x in np.median(joint_errors(cells), axis=0)],
        'nmse_percent_mean': _median([score.mean for score in scores]),
        'global_mse': _median([sum(x**2 for x in score.rmse) for score in scores]),
        'kinetic_nmse_percent': _median([score.kinetic_nmse_percent for score in scores]),
        'potential_nmse_percent': _median([score.potential_nmse_percent for score in scores]),
        'fit_seconds': _median([cell.fit_seconds for cell in cells]),
        'query_us': _median([cell.query_us for cell in cells]),
        'size': _median([float(cell.size) for cell in cells]),
    }


def _median(values: Sequence[float]) -> float | None:
    return _number(np.median(values))


def _number(value: Any) -> float | None:
    return None if math.isnan(value) else float(value)
