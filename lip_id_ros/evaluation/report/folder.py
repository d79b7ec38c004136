"""A folder of pictures and the page that shows them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import io
import os
from pathlib import Path

from matplotlib.figure import Figure

from lip_id_ros.evaluation.report.page import Picture
from lip_id_ros.evaluation.report.style import styled
from lip_id_ros.files import write_whole
from lip_id_ros.progress import Progress

INDEX = 'index.html'

Drawing = tuple[str, str, str, Callable[[], Figure]]
"""Name, title, caption, and what draws it."""


def picture(name: str, title: str, caption: str, figure: Figure) -> Picture:
    """Turn a figure into a picture of a page."""
    file = io.BytesIO()
    figure.savefig(file, format='png')
    return Picture(name, title, caption, file.getvalue())


def drawn(drawings: Iterable[Drawing], progress: Progress) -> list[Picture]:
    """Draw one after another in the style of the reports; progress is told after each."""
    todo = list(drawings)
    pictures = []
    with styled():
        for number, (name, title, caption, draw) in enumerate(todo, start=1):
            pictures.append(picture(name, title, caption, draw()))
            progress('plot', number, len(todo))
    return pictures


def write_folder(folder: str | os.PathLike[str], text: str, pictures: Iterable[Picture]) -> Path:
    """
    Write NAME.png for each picture, and index.html.

    Parameters
    ----------
    folder : path
        Made where it does not exist; files of an older report are replaced.
    text : str
        The page.
    pictures : iterable of Picture

    Returns
    -------
    Path
        The page.

    Raises
    ------
    OSError
        If the folder cannot be written.

    """
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    for each in pictures:
        write_whole(target / f'{each.name}.png', each.png)
    write_whole(target / INDEX, text.encode())
    return target / INDEX
