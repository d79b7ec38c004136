"""One page with all figures, which needs no network, and all numbers as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
import json
from pathlib import Path

from lip_id_ros.comparison import plots
from lip_id_ros.comparison.case import Case
from lip_id_ros.comparison.cell import Cell
from lip_id_ros.comparison.code_version import code_version
from lip_id_ros.comparison.run import Results
from lip_id_ros.comparison.store import Store
from lip_id_ros.comparison.summary import groups, meanings, remarks, tables, to_json
from lip_id_ros.evaluation.report.folder import Drawing, drawn, write_folder
from lip_id_ros.evaluation.report.page import page
from lip_id_ros.evaluation.tables import Table
from lip_id_ros.files import write_whole
from lip_id_ros.progress import Progress, silent

JSON = 'comparison.json'
BOXES = (
    'Each box: quartiles over the unseen motions; whiskers: up to 1.5 times their range. '
    'The scales are logarithmic.'
)
POINTS = 'On the one unseen motion. The scales are logarithmic.'
NOTES = (
    'nMSE = 100 mean(error^2) / var(torque), against the true torques where a simulation knows '
    'them, else against the measured ones; "mean" is over the joints. Less is better: 0 is '
    'perfect, 100 is no better than the mean of the torque. '
    'Energies are compared where they are known; the potential energy without its mean error.',
    'Times are of this machine, with whatever else it was doing.',
)


def write_comparison(
    folder: Path,
    title: str,
    cases: Sequence[Case],
    results: Results,
    store: Store,
    facts: Sequence[tuple[str, str]],
    progress: Progress = silent,
) -> Path:
    """
    Write index.html, its pictures and comparison.json.

    Parameters
    ----------
    folder : Path
        Exists.
    title : str
    cases : sequence of Case
    results : Results
    store : Store
        Where the cells are.
    facts : sequence of (str, str)
        Where the data come from, and the like.
    progress : callable

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    drawings = [*_boxes(results), *_curves(results), *_energies(cases, results, store)]
    pictures = drawn(drawings, progress)
    notes = [*(f'{name}: {what}.' for name, what in meanings(results.cells).items()), *NOTES]
    known = Table('Where this comes from', (), [*facts, ('code', code_version())])
    text = page(title, remarks(results), tables(results), notes, pictures, known)
    numbers = json.dumps(to_json(results), indent=1, allow_nan=False) + '\n'
    write_whole(folder / JSON, numbers.encode())
    return write_folder(folder, text, pictures)


def _boxes(results: Results) -> Iterator[Drawing]:
    for number, (group, by_model) in enumerate(groups(results.cells).items(), start=1):
        caption = BOXES if plots.several(by_model) else POINTS
        yield f'errors_{number}', f'{group}: errors', caption, partial(plots.boxes, by_model)


def _curves(results: Results) -> Iterator[Drawing]:
    by_model: dict[str, list[Cell]] = {}
    for cell in results.cells:
        by_model.setdefault(cell.model, []).append(cell)
    if len({cell.n_train for cell in results.cells}) > 1:
        caption = 'Medians over the unseen motions.'
        title = 'Errors against the number of training samples'
        yield 'learning', title, caption, partial(plots.learning_curves, by_model)


def _energies(cases: Sequence[Case], results: Results, store: Store) -> Iterator[Drawing]:
    last = cases[-1]
    answers = {
        cell.model: answer
        for cell, path in zip(results.cells, results.paths, strict=True)
        if cell.case == last.name and (answer := store.answer(path)).kinetic is not None
    }
    if answers:
        name, test = next(iter(last.tests.items()))
        caption = (
            f'Energies on {name}, learned from {last.name}. The potential energy is known up to a '
            'constant; the curves are moved to a common mean.'
        )
        palette = plots.colors(list(dict.fromkeys(cell.model for cell in results.cells)))
        yield 'energies', 'Energies', caption, partial(plots.energies, test, answers, palette)
