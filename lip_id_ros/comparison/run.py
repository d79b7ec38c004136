"""Every method on every case, what is finished already left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

from lip_id_ros.baselines import Method, method
from lip_id_ros.comparison.case import Case
from lip_id_ros.comparison.cell import Cell, measure
from lip_id_ros.comparison.store import Store
from lip_id_ros.errors import DataError, FitError
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import FitSettings

CELLS, THIS_FIT = 'models', 'this fit'

Make = Callable[[str, Case], Method]


@dataclass(frozen=True)
class Results:
    """
    What came out.

    Attributes
    ----------
    cells : tuple of Cell
        In the order of cases, then of models.
    paths : tuple of Path
        Where each is kept.
    failures : tuple of str
        Sentences: what could not be fitted, and why. Tried again next time.

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
    Fit and judge every model on every case.

    Parameters
    ----------
    cases : sequence of Case
    models : sequence of str
        Names of `lip_id_ros.baselines.MODELS`.
    settings : FitSettings
        The same for all of them.
    store : Store
        Finished cells are taken from there and put there.
    progress : callable
    make : callable, optional
        Makes the method of a name for a case; `lip_id_ros.baselines.method` by default.

    Returns
    -------
    Results

    Raises
    ------
    ConfigError
        If there is no such model, or one needs a URDF that a case has not.
    LipIdError
        If a package is missing.
    OSError
        If a cell cannot be written.

    """
    make = make or _by_name
    for case, model in product(cases, models):
        make(model, case)  # what is missing is said before the work, not after it
    cells, paths, failures = [], [], []
    todo = list(product(cases, models))
    for number, (case, model) in enumerate(todo):
        progress(CELLS, number, len(todo))
        path = store.path(case, model, settings)
        cell = store.load(path)
        if cell is None:
            try:
                cell, answer = measure(case, model, make(model, case), settings, _inner(progress))
            except (DataError, FitError) as error:
                failures.append(f'{model} on {case.name}: {error}')
                continue
            store.save(path, cell, answer)
        cells.append(cell)
        paths.append(path)
    progress(CELLS, len(todo), len(todo))
    return Results(tuple(cells), tuple(paths), tuple(failures))


def _by_name(name: str, case: Case) -> Method:
    return method(name, case.urdf)


def _inner(progress: Progress) -> Progress:
    return lambda _, done, total: progress(THIS_FIT, done, total)
