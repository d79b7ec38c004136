"""What `lip_id inspect` says of a file: of a model here, of anything else in recording/."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from lip_id_ros.files import read_npz
from lip_id_ros.model import TrainedModel
from lip_id_ros.model.model_file import SCHEMA
from lip_id_ros.progress import Progress
from lip_id_ros.recording import DATASET_SUFFIX, describe
from lip_id_ros.recording.description import Assess


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
    if Path(path).suffix == DATASET_SUFFIX and _is_model(path):
        return describe_model(path, TrainedModel.load(path))
    return describe(path, progress, assess)


def describe_model(path: str | os.PathLike[str], model: TrainedModel) -> dict[str, Any]:
    """Return the contents of a model as JSON knows them."""
    return {
        'file': os.fspath(path),
        'kind': 'model',
        'kernel': model.kernel,
        'joints': list(model.joint_names),
        'joint_types': list(model.joint_types),
        'samples': model.n_samples,
        'has_potential_energy': model.has_potential,
        'fit': dict(model.summary),
        'provenance': dict(model.provenance),
    }


def _is_model(path: str) -> bool:
    try:
        return read_npz(path)[1].get('schema') == SCHEMA
    except ValueError:
        return False
