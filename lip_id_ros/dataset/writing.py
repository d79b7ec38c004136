"""How a data set is written, by the suffix of its file."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path

from lip_id_ros.dataset.csv_file import CSV_SUFFIX, write_csv
from lip_id_ros.dataset.dataset import Dataset
from lip_id_ros.errors import ConfigError

Writer = Callable[[str | os.PathLike[str], Dataset], None]


def writer_for(path: str | os.PathLike[str]) -> Writer:
    """
    Choose how a data set is written by the suffix of its file.

    Raises
    ------
    ConfigError
        If it is neither .npz nor .csv.

    """
    suffix = Path(path).suffix
    if suffix not in WRITERS:
        raise ConfigError(
            f'{os.fspath(path)} must end in {" or ".join(WRITERS)}, '
            'which chooses the format of the data set; give it one of these endings.'
        )
    return WRITERS[suffix]


def _npz(path: str | os.PathLike[str], data: Dataset) -> None:
    data.save(path)


WRITERS: dict[str, Writer] = {'.npz': _npz, CSV_SUFFIX: write_csv}
