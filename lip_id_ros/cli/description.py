"""What `lip_id inspect` says of a file: of a model here, of anything else in preprocessing/."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lip_id_ros.dataset import DATASET_SUFFIX
from lip_id_ros.model.checked_file import COMPARED, MODEL, schema_of
from lip_id_ros.preprocessing import describe
from lip_id_ros.preprocessing.description import Assess
from lip_id_ros.progress import Progress


def describe_file(path: str, progress: Progress, assess: Assess) -> dict[str, Any]:
    """
    Describe a recording, a data set or a model.

    Parameters
    ----------
    path : str
    progress : callable
    assess : callable
        Asked what more is to be said of the samples of a recording.

    Raises
    ------
    LipIdError
        If it is none of these, or a damaged one.
    OSError
        If it does not exist or cannot be opened.

    """
    if Path(path).suffix == DATASET_SUFFIX and schema_of(path) in (MODEL, COMPARED):
        from lip_id_ros.cli.models import load  # needs far more than a recording does

        return {'file': path, 'kind': 'model', **load(path).described()}
    return describe(path, progress, assess)
