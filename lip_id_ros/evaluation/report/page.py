"""Pictures, and one self-contained HTML page with them."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
import html
import io
import os
from pathlib import Path

from matplotlib.figure import Figure

from lip_id_ros.errors import printable
from lip_id_ros.evaluation.report.style import styled
from lip_id_ros.evaluation.tables import Table
from lip_id_ros.files import write_whole
from lip_id_ros.progress import Progress

INDEX = 'index.html'
MAKER = '<meta name="generator" content="lip_id_ros">'

Drawing = tuple[str, str, str, Callable[[], Figure]]
"""Name, title, caption, and the function that draws the figure."""

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
.facts td { text-align: left; overflow-wrap: anywhere; padding: 3px 14px; }
.facts td:first-child { white-space: nowrap; }
.scroll { overflow-x: auto; margin-bottom: 10px; }
"""


@dataclass(frozen=True)
class Picture:
    """A PNG image of the page, its heading and its caption."""

    name: str
    title: str
    caption: str
    png: bytes


def write_page(
    folder: str | os.PathLike[str],
    title: str,
    facts: Iterable[tuple[str, str]],
    warnings: Iterable[str],
    tables: Iterable[Table],
    notes: Iterable[str],
    pictures: Sequence[Picture],
    details: Iterable[Table] = (),
) -> Path:
    """
    Write NAME.png for each picture, and index.html in place of an older; return the latter.

    The page needs no network: facts, warnings, tables, notes, pictures, and tables of details.
    """
    body = [
        f'<h1>{for_page(title)}</h1>',
        f'<div class="scroll"><table class="facts">\n{_rows(facts)}\n</table></div>',
        *(f'<p class="warning">{for_page(warning)}</p>' for warning in warnings),
        *(_table(table) for table in tables),
        *(f'<p>{for_page(note)}</p>' for note in notes),
        *(_figure(picture) for picture in pictures),
        *(_table(table) for table in details),
    ]
    text = (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'{MAKER}\n<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{for_page(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n'
        + '\n'.join(body)
        + '\n</main>\n</body>\n</html>\n'
    )
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    for each in pictures:
        write_whole(target / f'{each.name}.png', each.png)
    write_whole(target / INDEX, text.encode())
    return target / INDEX


def _table(table: Table) -> str:
    return (
        f'<h2>{for_page(table.title)}</h2>\n<div class="scroll"><table>\n'
        f'{_row("th", table.header)}\n{_rows(table.rows)}\n</table></div>'
    )


def _rows(rows: Iterable[Iterable[str]]) -> str:
    return '\n'.join(_row('td', row) for row in rows)


def _row(tag: str, cells: Iterable[str]) -> str:
    texts = (for_page(cell) for cell in cells)
    if tag == 'th':  # long joint names may break
        texts = (text.replace('_', '_<wbr>') for text in texts)
    return '<tr>' + ''.join(f'<{tag}>{text}</{tag}>' for text in texts) + '</tr>'


def _figure(picture: Picture) -> str:
    image = base64.b64encode(picture.png).decode('ascii')
    return (
        f'<h2>{for_page(picture.title)}</h2>\n<p>{for_page(picture.caption)}</p>\n'
        f'<figure><img alt="{for_page(picture.title)}" '
        f'src="data:image/png;base64,{image}"></figure>'
    )


def picture(name: str, title: str, caption: str, figure: Figure) -> Picture:
    """Turn a figure into a picture of a page."""
    file = io.BytesIO()
    figure.savefig(file, format='png')
    return Picture(name, title, caption, file.getvalue())


def drawn(drawings: Iterable[Drawing], progress: Progress) -> list[Picture]:
    """Draw one after another in the style of the reports."""
    todo = list(drawings)
    pictures = []
    with styled():
        for number, (name, title, caption, draw) in enumerate(todo, start=1):
            pictures.append(picture(name, title, caption, draw()))
            progress('plot', number, len(todo))
    return pictures


def for_page(text: str) -> str:
    """Return text that a browser shows as it is."""
    return html.escape(printable(text))
