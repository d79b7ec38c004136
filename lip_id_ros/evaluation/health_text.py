"""The health of a recording as a table and as lines of text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from lip_id_ros.evaluation.tables import Table

COLUMNS = {
    'range': 'range',
    'velocity_rms': 'velocity rms',
    'acceleration_p99': 'acceleration',
    'velocity_scale': 'velocity / dq',
    'effort_explained': 'effort explained',
}
TITLE = 'motion in rad or m and seconds; what a crude model explains of the effort'
MOST_LINES = 2


def health_table(joints: Mapping[str, Mapping[str, float | None]]) -> Table:
    """Return the figures of each joint, as `lip_id_ros.health.health` gives them."""
    known = [name for name in COLUMNS if any(name in figures for figures in joints.values())]
    rows = [
        (joint, *(_text(name, figures.get(name)) for name in known))
        for joint, figures in joints.items()
    ]
    return Table(TITLE, ('', *(COLUMNS[name] for name in known)), rows)


def lines(findings: Iterable[Mapping[str, Any]]) -> list[str]:
    """
    Return a line for each finding.

    Where more than two are of one kind, the first speaks for all, and their joints are named
    behind it.

    """
    kinds: dict[str, list[Mapping[str, Any]]] = {}
    for finding in findings:
        kinds.setdefault(finding['code'], []).append(finding)
    return [line for alike in kinds.values() for line in _lines(alike)]


def notable(healths: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return what is wrong with the recordings of a fit; notes only by their number."""
    findings = [finding for health in healths for finding in health['findings']]
    notes = sum(finding['severity'] == 'note' for finding in findings)
    texts = lines(finding for finding in findings if finding['severity'] != 'note')
    return texts + (
        [f'Notes not shown here: {notes}; see them with lip_id inspect.'] if notes else []
    )


def _lines(alike: Sequence[Mapping[str, Any]]) -> list[str]:
    texts = [f'{each["severity"]} {each["code"]}: {each["text"]}' for each in alike]
    if len(texts) <= MOST_LINES:
        return texts
    others = dict.fromkeys(each['joint'] for each in alike[1:])
    return [f'{texts[0]} Likewise {", ".join(others)}.']


def _text(name: str, value: float | None) -> str:
    if value is None:
        return '-'
    return f'{100 * value:.3g} %' if name == 'effort_explained' else f'{value:.3g}'
