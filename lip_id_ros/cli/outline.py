"""Nested descriptions as indented lines, and ranges of joints as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console

from lip_id_ros.evaluation.health_text import health_table, lines
from lip_id_ros.evaluation.tables import Table
from lip_id_ros.evaluation.terminal import show

RANGES = 'ranges'
HEALTH = 'health'
UNITS = 'rad or m and per second; effort as recorded, tau in N m or N'
INDENT = '  '
Ranges = Mapping[str, Mapping[str, Sequence[float] | None]]


def described(description: Mapping[str, Any], console: Console, indent: str = '') -> None:
    """
    Show a description.

    Parameters
    ----------
    description : mapping
        As `lip_id_ros.preprocessing.describe` returns it: JSON-able, nested.
    console : rich.console.Console
    indent : str
        Put before every line.

    """
    for name, value in description.items():
        if name == RANGES:
            show(ranges(value), console)
        elif name == HEALTH:
            _health(value, console)
        elif _is_list_of_mappings(value):
            for number, entry in enumerate(value, start=1):
                _line(f'{indent}{name} {number}:', console)
                described(entry, console, indent + INDENT)
        elif isinstance(value, Mapping) and value:
            _line(f'{indent}{name}:', console)
            described(value, console, indent + INDENT)
        else:
            _line(f'{indent}{name}: {_text(value)}', console)


def _health(health: Mapping[str, Any], console: Console) -> None:
    show(health_table(health['joints']), console)
    for line in lines(health['findings']) or ['nothing suspicious was found']:
        _line(line, console)


def ranges(by_joint: Ranges) -> Table:
    """Return lowest and highest values per joint and signal as a table."""
    signals = list(next(iter(by_joint.values()), {}))
    rows = [
        (joint, *(_range(values[signal]) for signal in signals))
        for joint, values in by_joint.items()
    ]
    return Table(f'ranges, {UNITS}', ('', *signals), rows)


def _range(values: Sequence[float] | None) -> str:
    return 'absent' if values is None else f'{values[0]:.3g} to {values[1]:.3g}'


def _is_list_of_mappings(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], Mapping)


def _text(value: Any) -> str:
    if isinstance(value, list):
        return ', '.join(_text(entry) for entry in value) or 'none'
    if value is None or value in ('', {}):
        return 'none'
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    return f'{value:.6g}' if isinstance(value, float) else str(value)


def _line(text: str, console: Console) -> None:
    console.print(text, markup=False, soft_wrap=True)
