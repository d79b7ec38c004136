"""Figures that are measured once, in a file that a benchmark resumes from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import json
from pathlib import Path
import sys
from typing import Any

import numpy as np

from lip_id_ros.files import write_whole

Row = dict[str, Any]


def by_error(rows: Sequence[Row]) -> list[Row]:
    """Return rows in the order of the geometric means of their errors."""
    return sorted(rows, key=geometric_mean)


def geometric_mean(row: Row) -> float:
    """Return that of the errors of a row."""
    return float(np.exp(np.log(row['nmse']).mean()))


def short(value: float) -> str:
    """Return a percentage as the tables have it."""
    return f'{value:.2g}' if value < 99.5 else f'{value:.0f}'


def line(*cells: str) -> str:
    """Return a row of a table in Markdown."""
    return f'| {" | ".join(cells)} |'


class Results:
    """Rows by name, in a JSON file that is written after each measurement; it need not exist."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.rows: dict[str, Row] = json.loads(path.read_text()) if path.exists() else {}

    def row(self, name: str, measure: Callable[[], Row]) -> Row:
        """Return a row, which is measured if the file lacks it."""
        if name not in self.rows:
            self.rows[name] = measure()
            write_whole(self._path, json.dumps(self.rows, indent=1, sort_keys=True).encode())
            print(name, json.dumps(self.rows[name]), file=sys.stderr, flush=True)
        return self.rows[name]
