"""Tables for a terminal."""

from __future__ import annotations

from typing import Literal

from rich.console import Console
import rich.table

from lip_id_ros.evaluation.tables import Table

WIDE = 1000  # more than any table needs


def show(table: Table, console: Console) -> None:
    """
    Print a table.

    Parameters
    ----------
    table : Table
    console : rich.console.Console
        Where to; one that is no terminal gets plain text in lines as long as they need be.

    """
    drawn = rich.table.Table(title=table.title, title_justify='left', title_style='bold')
    for number, name in enumerate(table.header):
        justify: Literal['left', 'right'] = 'right' if number else 'left'
        drawn.add_column(name, justify=justify, no_wrap=number == 0, overflow='fold')
    for row in table.rows:
        drawn.add_row(*row)
    if console.is_terminal:
        console.print(drawn)
    else:
        Console(file=console.file, width=WIDE, highlight=False).print(drawn)
