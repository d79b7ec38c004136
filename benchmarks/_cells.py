"""Cells of a table that are measured in processes of their own, each with its middleware."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import json
import os
import subprocess
import sys
import tempfile
from typing import Any

from rich.console import Console
from rich.table import Table

Row = dict[str, Any]


def measured(module: str, request: Mapping[str, Any]) -> Row:
    """
    Run a module with a JSON request, and return what it prints last.

    Parameters
    ----------
    module : str
        Such as 'benchmarks._serve_client'.
    request : mapping
        With the key `middleware`.

    """
    ran = subprocess.run(
        [sys.executable, '-m', module, json.dumps(request)],
        env={**os.environ, 'RMW_IMPLEMENTATION': request['middleware']},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    row: Row = json.loads(ran.stdout.splitlines()[-1])
    return row


def show(title: str, columns: Mapping[str, str], rows: Sequence[Row], width: int) -> None:
    """Print a table; `columns` are keys of the rows and their titles."""
    table = Table(title=title)
    for heading in columns.values():
        table.add_column(heading)
    for row in rows:
        values = [row.get(name, '') for name in columns]
        table.add_row(*(f'{v:.3g}' if isinstance(v, float) else str(v) for v in values))
    Console(width=width).print(table)


@contextmanager
def running(
    node: str, parameters: Mapping[str, str], arguments: Sequence[str] = ()
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a node of the package, such as 'serve', with ROS arguments while the block runs."""
    pairs = [part for each in parameters.items() for part in ('-p', '{}:={}'.format(*each))]
    command = [sys.executable, '-m', f'lip_id_ros.nodes.{node}', '--ros-args', *pairs, *arguments]
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(command, stdout=log, stderr=log)
        try:
            yield process
        finally:
            process.terminate()
            process.wait()
