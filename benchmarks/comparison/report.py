"""The page of a comparison: box plots, learning curves, energies; and all numbers as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
import json
import math
from pathlib import Path

from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter
import numpy as np

from benchmarks.comparison.cell import Case, Cell, code_version
from benchmarks.comparison.run import (
    ENERGIES,
    groups,
    joint_errors,
    mean_errors,
    meanings,
    remarks,
    Results,
    Store,
    tables,
    to_json,
)
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.escaping import for_plot
from lip_id_ros.evaluation.report import style
from lip_id_ros.evaluation.report.page import Drawing, drawn, write_page
from lip_id_ros.files import write_whole
from lip_id_ros.model import TorquePrediction
from lip_id_ros.progress import Progress, silent

N_COLUMNS = 4
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
    'Near rest: samples at which a joint is slower than 5 % of the root mean square of its '
    'velocity; there friction depends on how it came to rest.',
    'Times were measured on this machine, beside its other load.',
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
    Write index.html, its pictures and comparison.json into an existing folder; return the page.

    Parameters
    ----------
    store : Store
        Holds the cells.
    facts : sequence of (str, str)
        Name and value: origin of the data.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    drawings = [
        *_box_drawings(results),
        *_curve_drawings(results),
        *_energy_drawings(cases, results, store),
    ]
    pictures = drawn(drawings, progress)
    notes = [*(f'{name}: {what}.' for name, what in meanings(results.cells).items()), *NOTES]
    known = [*facts, ('code', code_version())]
    numbers = json.dumps(to_json(results), indent=1, allow_nan=False) + '\n'
    write_whole(folder / JSON, numbers.encode())
    return write_page(folder, title, known, remarks(results), tables(results), notes, pictures)


def _box_drawings(results: Results) -> Iterator[Drawing]:
    for number, (group, by_model) in enumerate(groups(results.cells).items(), start=1):
        caption = BOXES if several(by_model) else POINTS
        yield f'errors_{number}', f'{group}: errors', caption, partial(boxes, by_model)


def _curve_drawings(results: Results) -> Iterator[Drawing]:
    by_model: dict[str, list[Cell]] = {}
    for cell in results.cells:
        by_model.setdefault(cell.model, []).append(cell)
    if len({cell.n_train for cell in results.cells}) > 1:
        caption = 'Medians over the unseen motions.'
        title = 'Errors against the number of training samples'
        yield 'learning', title, caption, partial(learning_curves, by_model)


def _energy_drawings(cases: Sequence[Case], results: Results, store: Store) -> Iterator[Drawing]:
    last = cases[-1]
    answers = {
        cell.model: answer
        for cell, path in zip(results.cells, results.paths, strict=True)
        if cell.case == last.name and (answer := store.prediction(path)).kinetic is not None
    }
    if answers:
        name, test = next(iter(last.tests.items()))
        caption = (
            f'Energies on {name}, learned from {last.name}. The constant of the potential '
            'energy is free; the curves are shifted to a common mean.'
        )
        palette = colors(list(dict.fromkeys(cell.model for cell in results.cells)))
        yield 'energies', 'Energies', caption, partial(energies, test, answers, palette)


def colors(models: Sequence[str]) -> dict[str, style.Color]:
    """Return a colour for each model."""
    return {model: colormaps['tab10'](number % 10) for number, model in enumerate(models)}


def boxes(by_model: Mapping[str, Sequence[Cell]]) -> Figure:
    """Draw the errors of every joint and of their mean, a box, or a point, for each model."""
    joints = next(iter(by_model.values()))[0].joint_names
    panels = {
        name: {model: joint_errors(cells)[:, i] for model, cells in by_model.items()}
        for i, name in enumerate(joints)
    }
    panels['mean of the joints'] = {m: mean_errors(cells) for m, cells in by_model.items()}
    size = (style.WIDTH, 2.9 * math.ceil(len(panels) / N_COLUMNS))
    figure = Figure(figsize=size, layout='constrained')
    axes = style.grid(figure, len(panels), N_COLUMNS, sharey=True)
    draw = _boxes if several(by_model) else _points
    for panel, (title, errors) in zip(axes, panels.items(), strict=True):
        values = {model: _shown(x[np.isfinite(x)]) for model, x in errors.items()}
        draw(panel, values)
        _label(panel, title, values)
    figure.supylabel('nMSE [%]')
    return figure


def several(by_model: Mapping[str, Sequence[Cell]]) -> bool:
    """Whether there is more than one unseen motion, and so a box to be drawn."""
    return any(len(mean_errors(cells)) > 1 for cells in by_model.values())


def learning_curves(by_model: Mapping[str, Sequence[Cell]]) -> Figure:
    """Draw the median error, mean over the joints, against the number of training samples."""
    figure = Figure(figsize=(style.WIDTH, 4.2), layout='constrained')
    panel = figure.subplots()
    palette = colors(list(by_model))
    panel.set_xticks(sorted({cell.n_train for cells in by_model.values() for cell in cells}))
    for model, cells in by_model.items():
        counts = sorted({cell.n_train for cell in cells})
        medians = [
            np.median(mean_errors([cell for cell in cells if cell.n_train == count]))
            for count in counts
        ]
        panel.plot(
            counts, _shown(np.array(medians)), 'o-', color=palette[model], label=for_plot(model)
        )
    _logarithmic(panel)
    panel.margins(x=0.03)
    panel.set_xlabel('training samples')
    panel.set_ylabel('nMSE, mean of the joints [%]')
    panel.legend(loc='center left', bbox_to_anchor=(1, 0.5))
    return figure


def energies(
    test: Dataset, predictions: Mapping[str, TorquePrediction], palette: Mapping[str, style.Color]
) -> Figure:
    """Draw the predicted energies along one unseen motion, and the true ones where known."""
    known = {
        name: {
            model: x
            for model, prediction in predictions.items()
            if (x := getattr(prediction, name)) is not None
        }
        for name in ENERGIES
    }
    drawn = [name for name in ENERGIES if known[name]]
    figure = Figure(figsize=(style.WIDTH, 3.2 * len(drawn)), layout='constrained')
    panels = style.grid(figure, len(drawn), 1, sharex=True)
    for panel, name in zip(panels, drawn, strict=True):
        _energy(panel, test, name, known[name], palette)
    panels[-1].set_xlabel('time [s]')
    panels[0].legend(loc='center left', bbox_to_anchor=(1, 0.5))
    return figure


def _energy(
    panel: Axes,
    test: Dataset,
    name: str,
    found: Mapping[str, Array],
    palette: Mapping[str, style.Color],
) -> None:
    truth = getattr(test, name)
    if truth is not None:
        style.over_time(panel, test, truth, style.MEASURED, 'true', 4.0)
        _limit(panel, truth)
    for model, values in found.items():
        # the constant of the potential energy is free: the means are made equal
        middle = 0.0 if truth is None else truth.mean()
        offset = middle - values.mean() if name == 'potential' else 0.0
        style.over_time(panel, test, values + offset, palette[model], for_plot(model))
    panel.set_title(f'{name} energy', loc='left')
    panel.set_ylabel('energy [J]')


def _limit(panel: Axes, truth: Array) -> None:
    # a bad prediction must not hide the others
    margin = 0.5 * float(np.ptp(truth)) or 1.0
    panel.set_ylim(truth.min() - margin, truth.max() + margin)


def _boxes(panel: Axes, errors: Mapping[str, Array]) -> None:
    drawn = panel.boxplot(
        list(errors.values()), patch_artist=True, widths=0.6, medianprops={'color': 'black'}
    )
    for box, color in zip(drawn['boxes'], colors(list(errors)).values(), strict=True):
        box.set(facecolor=color, alpha=0.5)


def _points(panel: Axes, errors: Mapping[str, Array]) -> None:
    palette = colors(list(errors))
    for place, (model, values) in enumerate(errors.items(), start=1):
        panel.plot([place] * len(values), values, 'o', color=palette[model], markersize=9)
    panel.set_xlim(0.5, len(errors) + 0.5)


def _label(panel: Axes, title: str, errors: Mapping[str, Array]) -> None:
    panel.set_xticks(
        range(1, len(errors) + 1),
        [for_plot(model) for model in errors],
        rotation=60,
        ha='right',
        fontsize=9,
    )
    if any(x.size for x in errors.values()):
        _logarithmic(panel)
    panel.set_title(for_plot(title), loc='left', fontsize=10)


class _Plain(LogFormatter):
    """Writes 0.1 and 10 rather than powers of ten, where a label is due."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f'{x:g}' if super().__call__(x, pos) else ''


def _logarithmic(panel: Axes) -> None:
    panel.set_yscale('log')
    panel.yaxis.set_major_formatter(_Plain())
    panel.yaxis.set_minor_formatter(_Plain(minor_thresholds=(1, 0.4)))


def _shown(values: Array) -> Array:
    return np.maximum(values, style.LEAST_SHOWN)
