"""Run a comparison: every method on every case; finished cells are kept in a folder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
import hashlib
from itertools import product
import json
import os
from pathlib import Path

from lip_id_ros.arrays import Array
from lip_id_ros.baselines import Method, method
from lip_id_ros.comparison.cell import Case, Cell, measure
from lip_id_ros.errors import DataError, FitError
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.model import TorquePrediction
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import FitSettings

CELLS, THIS_FIT = 'models', 'this fit'
VERSION = 1  # of a cell's file
ENERGIES = ('kinetic', 'potential')

Make = Callable[[str, Case], Method]


class Store:
    """
    A folder with one file per cell.

    Data, model and settings identify a cell.

    Parameters
    ----------
    folder : path
        Created where it does not exist.

    Raises
    ------
    OSError
        If it cannot be created.

    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)

    def path(self, case: Case, model: str, settings: FitSettings) -> Path:
        """Return the file of a cell, which need not exist yet."""
        key = json.dumps([VERSION, case.fingerprint(), model, asdict(settings)], sort_keys=True)
        return self._folder / f'{model}-{hashlib.sha256(key.encode()).hexdigest()[:16]}.npz'

    def save(self, path: Path, cell: Cell, prediction: TorquePrediction) -> None:
        """
        Keep a cell, and the prediction on the first motion.

        Raises
        ------
        OSError
            If it cannot be written.

        """
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
        """
        Return the prediction on the first motion.

        Raises
        ------
        OSError
            If the cell cannot be read.

        """
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
    Fit and evaluate every model on every case.

    Parameters
    ----------
    cases : sequence of Case
    models : sequence of str
        Names of `lip_id_ros.baselines.MODELS`.
    settings : FitSettings
        The same for all of them.
    store : Store
        Holds the finished cells.
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


def _by_name(name: str, case: Case) -> Method:
    return method(name, case.urdf)


def _inner(progress: Progress) -> Progress:
    return lambda _, done, total: progress(THIS_FIT, done, total)
