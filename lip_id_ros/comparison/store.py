"""Finished cells in a folder, so that an interrupted comparison goes on where it ended."""

from __future__ import annotations

from dataclasses import asdict
import hashlib
import json
import os
from pathlib import Path

from lip_id_ros.arrays import Array
from lip_id_ros.baselines import Answer
from lip_id_ros.comparison.case import Case
from lip_id_ros.comparison.cell import Cell
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.settings import FitSettings

VERSION = 1
ENERGIES = ('kinetic', 'potential')


class Store:
    """
    A folder with one file per cell.

    A cell is found again where data, model and settings are the same; else it is another one.

    Parameters
    ----------
    folder : path
        Made where it does not exist.

    Raises
    ------
    OSError
        If it cannot be made.

    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)

    def path(self, case: Case, model: str, settings: FitSettings) -> Path:
        """Return where a cell is or will be."""
        key = json.dumps([VERSION, case.fingerprint(), model, asdict(settings)], sort_keys=True)
        return self._folder / f'{model}-{hashlib.sha256(key.encode()).hexdigest()[:16]}.npz'

    def save(self, path: Path, cell: Cell, answer: Answer) -> None:
        """
        Keep a cell, and what the method says of the first motion.

        Raises
        ------
        OSError
            If it cannot be written.

        """
        arrays = {'tau': answer.tau}
        arrays |= {name: x for name in ENERGIES if (x := getattr(answer, name)) is not None}
        write_npz(path, arrays, {'cell': cell.to_json()})

    def load(self, path: Path) -> Cell | None:
        """Return a kept cell; None where there is none, or only a damaged one."""
        try:
            return Cell.from_json(read_npz(path)[1]['cell'])
        except (FileNotFoundError, ValueError, KeyError):
            return None

    def answer(self, path: Path) -> Answer:
        """
        Return what the method says of the first motion.

        Raises
        ------
        OSError
            If the cell cannot be read.

        """
        arrays: dict[str, Array] = read_npz(path)[0]
        return Answer(arrays['tau'], arrays.get('kinetic'), arrays.get('potential'))
