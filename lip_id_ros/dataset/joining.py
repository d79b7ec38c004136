"""Several data sets of one arm joined into one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lip_id_ros.arrays import IntArray
from lip_id_ros.dataset.checks import PER_JOINT, PER_SAMPLE
from lip_id_ros.dataset.dataset import Dataset
from lip_id_ros.errors import DataError


def concatenate(datasets: Sequence[Dataset]) -> Dataset:
    """
    Join data sets of the same joints; segments and recordings of each get new numbers.

    Joints are matched by name, in the order of the first data set. True torques and energies are
    kept only where every data set has them.

    Raises
    ------
    DataError
        If there is none, or joints, joint types or gravity compensation differ.

    """
    if not datasets:
        raise DataError('at least one data set is needed to concatenate, not 0.')
    first = datasets[0]
    if len(datasets) == 1:
        return first
    for other in datasets[1:]:
        _check_alike(first, other)
    ordered = [data.with_joints(first.joint_names) for data in datasets]
    values = {
        name: np.concatenate([getattr(data, name) for data in ordered])
        for name in (*PER_SAMPLE, *PER_JOINT)
        if all(getattr(data, name) is not None for data in ordered)
    }
    return Dataset(
        **values,
        joint_names=first.joint_names,
        joint_types=first.joint_types,
        segment=_renumbered([data.segment for data in ordered]),
        recording=_renumbered([data.recording for data in ordered]),
        gravity_compensated=first.gravity_compensated,
        provenance={'sources': [source for data in ordered for source in _sources(data)]},
    )


def _sources(dataset: Dataset) -> list[Any]:
    return list(dataset.provenance.get('sources', [dict(dataset.provenance)]))


def _renumbered(indices: Sequence[IntArray]) -> IntArray:
    renumbered, used = [], 0
    for index in indices:
        numbers, inverse = np.unique(index, return_inverse=True)
        renumbered.append(used + inverse.astype(np.int64))
        used += numbers.size
    return np.concatenate(renumbered)


def _check_alike(first: Dataset, other: Dataset) -> None:
    if set(first.joint_names) != set(other.joint_names):
        raise DataError(
            f'sources must have the same joints, not {", ".join(first.joint_names)} and '
            f'{", ".join(other.joint_names)}; choose joints that all of them have.'
        )
    if first.joint_types != other.with_joints(first.joint_names).joint_types:
        raise DataError(
            f'sources must agree on joint types, not {", ".join(first.joint_types)} and '
            f'{", ".join(other.joint_types)}; correct recording.joint_types or the data set.'
        )
    if first.gravity_compensated != other.gravity_compensated:
        raise DataError(
            'sources with and without gravity in their torques cannot be joined; '
            'use one kind, or correct recording.gravity_compensated.'
        )
