"""Whether a model is being judged on what it was fitted on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.dataset import Dataset
from lip_id_ros.model import TrainedModel

SAME_RECORDING = ('topic', 'start_s', 'samples')


def warnings(model: TrainedModel, dataset: Dataset) -> list[str]:
    """
    Say so where a data set is, or may be, what a model was fitted on.

    Parameters
    ----------
    model : TrainedModel
    dataset : Dataset
        With the model's joints in the model's order.

    Returns
    -------
    list of str
        Sentences; none where the data are new to the model.

    """
    n_shared = int(np.isin(_rows(model.states), _rows(dataset)).sum())
    if n_shared:
        return [
            f'These are training data: {n_shared} of the {model.n_samples} samples of the model '
            f'are among the {dataset.n_samples} evaluated; the errors say little about other '
            'motions.'
        ]
    return same_recording(model.provenance, dataset)


def same_recording(provenance: Mapping[str, Any], dataset: Dataset) -> list[str]:
    """Say so where a data set comes from a recording that a model was fitted on."""
    known = _recordings(provenance)
    if any(recording in known for recording in _recordings(dataset.provenance)):
        return [
            'The model was fitted on samples of the same recording; '
            'the errors may be smaller than on other motions.'
        ]
    return []


def _rows(states: Any) -> NDArray[np.void]:
    """View the positions and velocities of each sample as one value that can be compared."""
    motion = np.ascontiguousarray(np.hstack([states.q, states.dq]))
    return motion.view(np.dtype((np.void, motion.itemsize * motion.shape[1]))).ravel()


def _recordings(provenance: Mapping[str, Any]) -> list[tuple[Any, ...]]:
    """Recognize recordings by what they hold, since files are renamed and moved."""
    sources = [source for source in provenance.get('sources', []) if isinstance(source, Mapping)]
    return [
        tuple(source[name] for name in SAME_RECORDING)
        for source in sources
        if all(name in source for name in SAME_RECORDING)
    ]
