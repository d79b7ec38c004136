"""One HTML page that needs no network and no other file."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from dataclasses import dataclass
from html import escape

from lip_id_ros.evaluation.tables import Table

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1f2933; background: #f5f7fa; margin: 0; }
main { max-width: 1100px; margin: 0 auto; padding: 24px; }
h1 { font-size: 26px; margin: 8px 0; }
h2 { font-size: 19px; margin: 36px 0 8px; }
p { margin: 6px 0; }
table { border-collapse: collapse; background: white; }
th, td { padding: 6px 14px; text-align: right; border-bottom: 1px solid #e4e7eb; }
th:first-child, td:first-child { text-align: left; }
td { font-variant-numeric: tabular-nums; }
figure { margin: 0; background: white; padding: 12px; border: 1px solid #e4e7eb; }
figure img { width: 100%; height: auto; display: block; }
.warning { background: #fef3c7; border-left: 4px solid #d97706; padding: 8px 14px; }
.facts td { text-align: left; overflow-wrap: anywhere; }
.scroll { overflow-x: auto; margin-bottom: 10px; }
"""


@dataclass(frozen=True)
class Picture:
    """A PNG image of the page, its heading and what there is to see."""

    name: str
    title: str
    caption: str
    png: bytes


def page(
    title: str,
    warnings: Iterable[str],
    tables: Iterable[Table],
    notes: Iterable[str],
    pictures: Iterable[Picture],
    facts: Table,
) -> str:
    """
    Write the page.

    Parameters
    ----------
    title : str
    warnings : iterable of str
        Shown above everything else.
    tables : iterable of Table
        The errors.
    notes : iterable of str
        Shown below the tables.
    pictures : iterable of Picture
        Embedded in the page.
    facts : Table
        Where model and data come from; its header is not shown.

    Returns
    -------
    str
        HTML.

    """
    body = [
        f'<h1>{escape(title)}</h1>',
        *(f'<p class="warning">{escape(warning)}</p>' for warning in warnings),
        *(_table(table) for table in tables),
        *(f'<p>{escape(note)}</p>' for note in notes),
        *(_figure(picture) for picture in pictures),
        _facts(facts),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n'
        + '\n'.join(body)
        + '\n</main>\n</body>\n</html>\n'
    )


def _table(table: Table) -> str:
    return (
        f'<h2>{escape(table.title)}</h2>\n<div class="scroll"><table>\n'
        f'{_row("th", table.header)}\n' + _rows(table) + '\n</table></div>'
    )


def _facts(table: Table) -> str:
    return (
        f'<h2>{escape(table.title)}</h2>\n<div class="scroll"><table class="facts">\n'
        + _rows(table)
        + '\n</table></div>'
    )


def _rows(table: Table) -> str:
    return '\n'.join(_row('td', row) for row in table.rows)


def _row(tag: str, cells: Iterable[str]) -> str:
    texts = (escape(cell) for cell in cells)
    if tag == 'th':  # long names of joints may break
        texts = (text.replace('_', '_<wbr>') for text in texts)
    return '<tr>' + ''.join(f'<{tag}>{text}</{tag}>' for text in texts) + '</tr>'


def _figure(picture: Picture) -> str:
    image = base64.b64encode(picture.png).decode('ascii')
    return (
        f'<h2>{escape(picture.title)}</h2>\n<p>{escape(picture.caption)}</p>\n'
        f'<figure><img alt="{escape(picture.title)}" '
        f'src="data:image/png;base64,{image}"></figure>'
    )
