"""Predictions along a data set, their file, and whether the data are those of the training."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
import os
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, EVERY, Rows
from lip_id_ros.dataset import cutoffs_hz, Dataset
from lip_id_ros.errors import ModelError
from lip_id_ros.files import read_header, write_npz
from lip_id_ros.identification.folds import at_rest
from lip_id_ros.model import (
    DynamicsModel,
    InverseDynamicsModel,
    StandardDeviation,
    TorqueModel,
    TorquePrediction,
)
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording.sketch import have_common_samples, SKETCH

BLOCK = 500
STD_BLOCK, ARM_STD_BLOCK = 50, 2000  # the path of all samples is looked at for each block
MOST_COVERED = 500  # samples of which a coverage is the share

FORMAT, VERSION = 'lip_id_ros prediction', 1
TORQUES = ('tau', 'inertial', 'coriolis', 'gravity', 'friction')
ENERGIES = ('kinetic', 'potential')
UNITS = {
    't': 's',
    **dict.fromkeys((*TORQUES, 'tau_std', 'measurement_std', 'tau_measured'), 'N m or N'),
    **dict.fromkeys((*ENERGIES, 'kinetic_std', 'potential_std'), 'J'),
}
"""Of the arrays of a file of predictions, by the names of interfaces.md."""

Blocks = TypeVar('Blocks', bound=Any)


@dataclass(frozen=True)
class Outcome:
    """
    Predictions beside the N samples that they are for.

    `smallest_eigenvalue`, shape (N,): of the predicted inertia matrix [kg m^2 or kg]; None where
    the model has none. `within_two_std_percent`, shape (n,): share of measured torques within two
    standard deviations of a measurement; None where the model is no arm, or efforts were
    low-passed otherwise than those of its fit. `novelty`: median distance of the samples in motion
    to the training data, in that of left-out ones; None where the model does not know. `cautions`:
    sentences where the data are, or may be, training data.
    """

    dataset: Dataset
    prediction: TorquePrediction
    smallest_eigenvalue: Array | None = None
    within_two_std_percent: Array | None = None
    novelty: float | None = None
    cautions: tuple[str, ...] = ()

    @property
    def reference(self) -> Array:
        """Torques [N m or N], shape (N, n), to compare with: the true ones where known."""
        known = self.dataset.tau_noiseless
        return self.dataset.tau if known is None else known


def matched(dataset: Dataset, model: TorqueModel | Dataset) -> Dataset:
    """
    Return a data set with the joints of a model, in its order.

    DataError if a joint is missing. ModelError if a joint has another type than the model's, or
    only one of both leaves gravity out.
    """
    ordered = dataset.with_joints(model.joint_names)
    for name, found, expected in zip(
        model.joint_names, ordered.joint_types, model.joint_types, strict=True
    ):
        if found != expected:
            raise ModelError(
                f'joint {name!r} must be {expected} as in the model, but is {found} in the data; '
                'correct recording.joint_types, or fit a new model.'
            )
    without = _without_gravity(model)
    if without is not None and without != dataset.gravity_compensated:
        has = ('leave gravity out', 'contain gravity')
        raise ModelError(
            f'the torques of the data {has[without]}, but those that the model learned '
            f'{has[not without]}; correct recording.gravity_compensated, or fit a new model.'
        )
    return ordered


def _without_gravity(model: TorqueModel | Dataset) -> bool | None:
    """Return whether torques leave gravity out; None where the model does not tell."""
    if isinstance(model, Dataset):
        return model.gravity_compensated
    return not model.has_potential if isinstance(model, InverseDynamicsModel) else None


def run(model: TorqueModel, dataset: Dataset, progress: Progress = silent) -> Outcome:
    """Predict torques, energies and, where the model has them, inertia matrix and coverage."""
    predictions: list[TorquePrediction] = []
    eigenvalues = []
    arm = model if isinstance(model, InverseDynamicsModel) and model.arm is not None else None
    for q, dq, ddq in _state_blocks(dataset, progress):
        if arm is None:
            predictions.append(model.predict(q, dq, ddq))
        if isinstance(model, DynamicsModel):
            eigenvalues.append(np.linalg.eigvalsh(model.inertia_matrix(q))[:, 0])
    smallest = np.concatenate(eigenvalues) if eigenvalues else None
    if arm is not None:  # whole: friction may remember
        predictions = [arm.predict(dataset.q, dataset.dq, dataset.ddq, dataset.t)]
    joined = _joined(predictions)
    covered = _within_two_std(model, dataset, joined.tau)
    cautions = tuple(training_data_warnings(model, dataset))
    return Outcome(dataset, joined, smallest, covered, novelty_of(model, dataset), cautions)


def novelty_of(model: TorqueModel, dataset: Dataset) -> float | None:
    """Return the median novelty of samples in motion; None where the model knows no states."""
    if not isinstance(model, InverseDynamicsModel) or model.known_states is None:
        return None
    moving = ~at_rest(dataset)
    some = dataset.select(np.flatnonzero(moving)) if moving.any() else dataset
    return float(np.median(model.novelty(some.q, some.dq, some.ddq)))


def _within_two_std(model: TorqueModel, dataset: Dataset, tau: Array) -> Array | None:
    """Return the share [percent] of measurements that two standard deviations cover, (n,)."""
    if not isinstance(model, InverseDynamicsModel) or model.arm is None:
        return None  # deviations of a Gaussian process on energies take seconds
    if not cutoffs_hz(dataset.provenance) <= (cutoffs_hz(model.provenance) - {None} or {None}):
        return None  # the noise of the model is that of efforts with another bandwidth
    count = min(MOST_COVERED, dataset.n_samples)
    rows = np.linspace(0, dataset.n_samples - 1, count).astype(np.intp)
    std = standard_deviation(model, dataset, silent, rows).measurement
    return np.asarray(100.0 * np.mean(np.abs(dataset.tau - tau)[rows] <= 2.0 * std, axis=0))


def standard_deviation(
    model: DynamicsModel, dataset: Dataset, progress: Progress = silent, rows: Rows = EVERY
) -> StandardDeviation:
    """Compute the standard deviations of torques and energies at every sample, or at some."""
    chosen = np.arange(dataset.n_samples)[rows]
    states = dataset.q, dataset.dq, dataset.ddq, dataset.t
    blocks, size = [], STD_BLOCK if getattr(model, 'process', None) else ARM_STD_BLOCK
    for begin in range(0, chosen.size, size):
        some = chosen[begin : begin + size]
        blocks.append(model.standard_deviation(*states, rows=some))
        progress('standard deviation', begin + some.size, chosen.size)
    return _joined(blocks)


def _state_blocks(dataset: Dataset, progress: Progress) -> Iterator[tuple[Array, Array, Array]]:
    for begin in range(0, dataset.n_samples, BLOCK):
        rows = slice(begin, begin + BLOCK)
        yield dataset.q[rows], dataset.dq[rows], dataset.ddq[rows]
        progress('predict', min(begin + BLOCK, dataset.n_samples), dataset.n_samples)


def _joined(blocks: Sequence[Blocks]) -> Blocks:
    columns = {}
    for field in fields(blocks[0]):
        parts = [getattr(block, field.name) for block in blocks]
        columns[field.name] = None if parts[0] is None else np.concatenate(parts)
    joined: Blocks = type(blocks[0])(**columns)
    return joined


def training_data_warnings(model: Any, dataset: Dataset) -> list[str]:
    """Return sentences where a data set is, or may be, the training data of a model."""
    process = getattr(model, 'process', None)
    own = _motion_rows(process.states) if process else _motion_rows(dataset)[:0]
    n_shared = int(np.isin(own, _motion_rows(dataset)).sum())
    if n_shared:
        return [
            f'These are training data: {n_shared} of the {len(own)} samples of the model '
            f'are among the {dataset.n_samples} evaluated; errors on other motions may be larger.'
        ]
    known, sketch = _contents(getattr(model, 'provenance', {}))
    recordings, other = _contents(dataset.provenance)
    if not known.isdisjoint(recordings) or have_common_samples(sketch, other):
        return [
            'The model was fitted on samples of the same recording, or of a copy of it; '
            'errors on other motions may be larger.'
        ]
    return []


def _motion_rows(states: Any) -> NDArray[np.void]:
    """View the positions and velocities of each sample as one value that can be compared."""
    motion = np.ascontiguousarray(np.hstack([states.q, states.dq]))
    return motion.view(np.dtype((np.void, motion.itemsize * motion.shape[1]))).ravel()


def _contents(provenance: Mapping[str, Any]) -> tuple[set[str], str]:
    """Return digests and sketches of the recordings, since files are renamed, moved and copied."""
    sources = [x for x in provenance.get('sources', ()) if isinstance(x, Mapping)]
    digests = {digest for source in sources if (digest := source.get('content'))}
    return digests, ''.join(source.get(SKETCH, '') for source in sources)


def predicted_values(
    model: TorqueModel, outcome: Outcome, progress: Progress = silent
) -> dict[str, Array]:
    """Return torques, and the parts, energies and standard deviations that the model has."""
    found = {name: getattr(outcome.prediction, name, None) for name in (*TORQUES, *ENERGIES)}
    if isinstance(model, DynamicsModel):
        std = standard_deviation(model, outcome.dataset, progress)
        found |= {f'{name}_std': getattr(std, name) for name in ('tau', 'measurement', *ENERGIES)}
    return {name: values for name, values in found.items() if values is not None}


def write_prediction(
    path: str | os.PathLike[str], data: Dataset, found: Mapping[str, Array]
) -> None:
    """Write predictions beside the measurement; see interfaces.md."""
    arrays: dict[str, Any] = {'t': data.t, 'segment': data.segment, 'tau_measured': data.tau}
    arrays |= found
    units = {name: unit for name, unit in UNITS.items() if name in arrays}
    names = {'joint_names': np.array(data.joint_names)}
    write_npz(path, arrays | names, {'format': FORMAT, 'version': VERSION, 'units': units})


def is_prediction(path: Path) -> bool:
    """Whether a file is a prediction."""
    try:
        return read_header(path).get('format') == FORMAT
    except ValueError:
        return False
