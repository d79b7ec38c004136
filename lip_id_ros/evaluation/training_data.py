"""Whether a data set is, or may be, the training data of a model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.dataset import Dataset
from lip_id_ros.recording.sketch import have_common_samples, SKETCH


def training_data_warnings(model: Any, dataset: Dataset) -> list[str]:
    """Return sentences where a data set is, or may be, the training data of a model."""
    process = getattr(model, 'process', None)
    own = _rows(process.states) if process else _rows(dataset)[:0]
    n_shared = int(np.isin(own, _rows(dataset)).sum())
    if n_shared:
        return [
            f'These are training data: {n_shared} of the {len(own)} samples of the model '
            f'are among the {dataset.n_samples} evaluated; errors on other motions may be larger.'
        ]
    known, sketch = _recordings(getattr(model, 'provenance', {}))
    recordings, other = _recordings(dataset.provenance)
    if not known.isdisjoint(recordings) or have_common_samples(sketch, other):
        return [
            'The model was fitted on samples of the same recording, or of a copy of it; '
            'errors on other motions may be larger.'
        ]
    return []


def _rows(states: Any) -> NDArray[np.void]:
    """View the positions and velocities of each sample as one value that can be compared."""
    motion = np.ascontiguousarray(np.hstack([states.q, states.dq]))
    return motion.view(np.dtype((np.void, motion.itemsize * motion.shape[1]))).ravel()


def _recordings(provenance: Mapping[str, Any]) -> tuple[set[str], str]:
    """Return digests and sketches of the recordings, since files are renamed, moved and copied."""
    sources = [x for x in provenance.get('sources', ()) if isinstance(x, Mapping)]
    digests = {digest for source in sources if (digest := source.get('content'))}
    return digests, ''.join(source.get(SKETCH, '') for source in sources)
