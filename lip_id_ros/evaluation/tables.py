"""Figures as tables of text, the same for terminals and web pages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
import math
import statistics
from typing import Literal, TYPE_CHECKING

from rich.console import Console
import rich.table
from rich.text import Text

from lip_id_ros.errors import printable
from lip_id_ros.joint_types import TORQUE_UNITS

if TYPE_CHECKING:
    from lip_id_ros.evaluation.metrics import Evaluation

LEAST_PERCENT = 0.0001
WIDE = 1000  # more than any table needs


@dataclass(frozen=True)
class Table:
    """A table of text: title, names of the columns, rows."""

    title: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


def show(table: Table, console: Console) -> None:
    """Print a table; in lines as long as necessary where the console is not a terminal."""
    drawn = rich.table.Table()
    for number, name in enumerate(table.header):
        justify: Literal['left', 'right'] = 'right' if number else 'left'
        drawn.add_column(_cell(name), justify=justify, no_wrap=number == 0, overflow='fold')
    for row in table.rows:
        drawn.add_row(*(_cell(text) for text in row))
    if not console.is_terminal:
        console = Console(file=console.file, width=WIDE, highlight=False)
    if table.title:  # above the table, which would wrap it to its own width
        console.print(Text(printable(table.title), style='bold'))
    console.print(drawn)


def show_lines(texts: Iterable[str], console: Console) -> None:
    """Print texts, one per line, without any markup that they may contain."""
    for text in texts:
        console.print(_cell(text), soft_wrap=not console.is_terminal)


def error_table(evaluation: Evaluation, title: str = 'Errors') -> Table:
    """Return errors and coverage of every joint, their means, and errors of the energies."""
    units = [TORQUE_UNITS[kind] for kind in evaluation.joint_types]
    columns = zip(
        evaluation.joint_names,
        evaluation.nmse_percent,
        units,
        evaluation.rmse,
        evaluation.torque_std,
        strict=True,
    )
    rows = [
        [name, percent(nmse), f'{rmse:.3g} {unit}', f'{std:.3g} {unit}']
        for name, nmse, unit, rmse, std in columns
    ]
    header = ['', 'nMSE [%]', 'RMSE', 'std of torque']
    if evaluation.rest is not None:
        header[3:3] = ['in motion', 'near rest']
        parts = evaluation.rest.in_motion, evaluation.rest.near_rest
        for row, unit, *values in zip(rows, units, *parts, strict=True):
            row[3:3] = ['-' if math.isnan(each) else f'{each:.3g} {unit}' for each in values]
    if evaluation.within_two_std_percent is not None:
        header.append('within 2 std [%]')
        for row, covered in zip(rows, evaluation.within_two_std_percent, strict=True):
            row.append(f'{covered:.3g}')
    rest = [''] * (len(header) - 2)
    rows.append(['mean of the joints', percent(evaluation.nmse_percent_mean), *rest])
    known = [max(x, LEAST_PERCENT) for x in evaluation.nmse_percent if not math.isnan(x)]
    if known:
        rows.append(['geometric mean', percent(statistics.geometric_mean(known)), *rest])
    for name, value in (
        ('kinetic energy', evaluation.kinetic_nmse_percent),
        ('potential energy', evaluation.potential_nmse_percent),
    ):
        if value is not None:
            rows.append([name, percent(value), *rest])
    return Table(title, header, rows)


def notes(evaluation: Evaluation) -> list[str]:
    """Return the reference of the errors, and whether the inertia matrix is positive definite."""
    from lip_id_ros.evaluation.metrics import NEAR_REST
    from lip_id_ros.model.known_states import novelty_in_words

    against = 'true torques of the simulation' if evaluation.against_truth else 'measured torques'
    texts = [
        f'{evaluation.n_samples} samples, compared with the {against}; '
        'nMSE = 100 mean(error^2) / var(torque).'
    ]
    if evaluation.rest is not None:
        texts.append(
            'In motion, near rest: RMSE of the samples at which the joint is faster, or slower, '
            f'than {100.0 * NEAR_REST:.0f} % of the root mean square of its velocity; near rest '
            'friction depends on how the joint came there.'
        )
    if evaluation.within_two_std_percent is not None:
        texts.append(
            'Within 2 std: share of measured torques within two standard deviations of the '
            'prediction; 95 % are expected, fewer on motions unlike those that were learned.'
        )
    if evaluation.novelty is not None:
        texts.append(
            f'Novelty {evaluation.novelty:.2g}: these motions are '
            f'{novelty_in_words(evaluation.novelty)}; 1 is the distance of left-out parts of the '
            'training data from the rest.'
        )
    if evaluation.inertia_not_pd_percent is None:
        return texts
    where = 'all samples'
    if share := evaluation.inertia_not_pd_percent:
        where = f'{100.0 - share:.3g} % of the samples only'
    eigenvalue = f'its smallest eigenvalue is {evaluation.inertia_min_eigenvalue:.3g}'
    return [*texts, f'The inertia matrix M(q) is positive definite at {where}; {eigenvalue}.']


def percent(value: float | None) -> str:
    """Return a percentage in three digits, or a dash where there is none."""
    if value is None or math.isnan(value):
        return '-'
    if value < LEAST_PERCENT:
        return f'<{LEAST_PERCENT}'
    return f'{value:.3g}' if value < 999.5 else f'{value:.0f}'


def _cell(text: str) -> Text:
    return Text(printable(text))
