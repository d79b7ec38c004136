"""Tables for a terminal."""

from __future__ import annotations

from rich.console import Console
import rich.table

from lip_id_ros.evaluation.tables import Table


def show(table: Table, console: Console) -> None:
    """
    Print a table.

    Parameters
    ----------
    table : Table
    console : rich.console.Console
        Where to; one that is no terminal gets plain text.

    """
    drawn = rich.table.Table(title=table.title, title_justify='left', title_style='bold')
    for number, name in enumerate(table.header):
        drawn.add_column(name, justify='right' if number else 'left', no_wrap=number == 0)
    for row in table.rows:
        drawn.add_row(*row)
    console.print(drawn)
