"""A folder of pictures and the page that shows them."""

from __future__ import annotations

from collections.abc import Iterable
import io
import os
from pathlib import Path
from typing import BinaryIO

from matplotlib.figure import Figure

from lip_id_ros.evaluation.report.page import Picture
from lip_id_ros.files import write_atomically

INDEX = 'index.html'


def picture(name: str, title: str, caption: str, figure: Figure) -> Picture:
    """Turn a figure into a picture of a page."""
    file = io.BytesIO()
    figure.savefig(file, format='png')
    return Picture(name, title, caption, file.getvalue())


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
        _write(target / f'{each.name}.png', each.png)
    _write(target / INDEX, text.encode())
    return target / INDEX


def _write(path: Path, content: bytes) -> None:
    def put(file: BinaryIO) -> None:
        file.write(content)

    write_atomically(path, put)
