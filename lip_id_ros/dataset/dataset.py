"""The data set: synchronous joint motions and torques, checked once and then read-only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import dataclasses
from dataclasses import dataclass, field
from numbers import Real
import os
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from lip_id_ros.arrays import Array, BoolArray, digest, IndexArray, IntArray
from lip_id_ros.dataset import formats
from lip_id_ros.dataset.checks import (
    checked,
    DERIVED,
    floats,
    INDICES,
    PER_JOINT,
    PER_SAMPLE,
    texts,
)
from lip_id_ros.dataset.formats import COPIES, cutoffs_hz
from lip_id_ros.dataset.subsets import farthest_points
from lip_id_ros.errors import DataError, missing_joints, shortened
from lip_id_ros.files import require_suffix
from lip_id_ros.joint_types import is_prismatic, JointHistory

_NO_NUMBERS: IntArray = np.empty(0, np.int64)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Dataset:
    """
    Samples of an arm's motion, N samples of n joints; every array is float64 and read-only.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Time [s], not decreasing within a segment.
    q, dq, ddq : ndarray, shape (N, n)
        Positions [rad or m], velocities, accelerations.
    tau : ndarray, shape (N, n)
        Measured torques or forces [N m or N].
    joint_names : tuple of str
        Unique names, from base to tip.
    joint_types : tuple of str
        'revolute' or 'prismatic' for each joint.
    segment : ndarray of int64, shape (N,)
        Samples of one uninterrupted motion share a number and lie together.
    recording : ndarray of int64, shape (N,), optional
        Number of the recording that a sample is from, the same throughout a segment; all 0 where
        not given.
    tau_noiseless : ndarray, shape (N, n), optional
        True torques, known in simulation.
    low_passed_sign : ndarray, shape (N, n), optional
        Signs of the velocities after the low-pass that the torques went through, by which dry
        friction is fitted; where not given, the sign at constant acceleration stands for it.
    dahl_states : ndarray, shape (N, n, D), optional
        States of Dahl's friction along all samples, before some of them are selected.
    kinetic, potential : ndarray, shape (N,), optional
        True energies [J], known in simulation.
    gravity_compensated : bool
        Whether `tau` leaves gravity out, so that no potential energy can be learned from it.
    provenance : mapping
        JSON-able: sources, counts of dropped samples, preprocessing.

    Raises
    ------
    ShapeError
        If an array does not have its shape, or a tuple its length.
    DataError
        If a number is not finite, names are not unique, a type is unknown, or time goes back.

    """

    t: Array
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    segment: IntArray
    recording: IntArray = field(default_factory=_NO_NUMBERS.copy)
    tau_noiseless: Array | None = None
    low_passed_sign: Array | None = None
    dahl_states: Array | None = None
    kinetic: Array | None = None
    potential: Array | None = None
    gravity_compensated: bool = False
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Copy, check and lock every array."""
        for name, value in checked(vars(self)).items():
            object.__setattr__(self, name, value)

    def _arrays(self) -> dict[str, Any]:
        values = {name: getattr(self, name) for name in (*PER_SAMPLE, *PER_JOINT, *INDICES)}
        return {name: value for name, value in values.items() if value is not None}

    def _recorded(self) -> dict[str, Any]:
        """Return the arrays but for what follows from them."""
        return {name: value for name, value in self._arrays().items() if name not in DERIVED}

    @classmethod
    def from_arrays(
        cls,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        tau: ArrayLike,
        joint_names: Sequence[str] | None = None,
        joint_types: Sequence[str] | None = None,
        t: ArrayLike | None = None,
    ) -> Self:
        """
        Make a data set of one uninterrupted motion; raises what the class raises.

        Parameters
        ----------
        q, dq, ddq, tau : array, shape (N, n), or (N,) for one joint
            Positions [rad or m], velocities, accelerations, torques or forces [N m or N].
        joint_names : sequence of str, optional
            From base to tip; joint_1, joint_2, ... where not given.
        joint_types : sequence of str, optional
            'revolute' or 'prismatic'; all revolute where not given.
        t : array, shape (N,), optional
            Time [s]; steps of 1 s where not given.

        """
        arrays = {'q': q, 'dq': dq, 'ddq': ddq, 'tau': tau}
        given: dict[str, Any] = {
            name: formats.as_columns(floats(name, array)) for name, array in arrays.items()
        }
        optional = {'t': t, 'joint_names': joint_names, 'joint_types': joint_types}
        given |= {name: value for name, value in optional.items() if value is not None}
        filled = formats.defaults(given['q'])
        defaults = {name: value for name, value in filled.items() if name not in given}
        source = {'source': 'arrays', 'defaults': list(defaults)}
        return cls(**given, **defaults, provenance={'sources': [source]})

    @property
    def n_samples(self) -> int:
        """Number of samples N."""
        return int(self.q.shape[0])

    def __repr__(self) -> str:
        return f'<data set of {", ".join(self.joint_names)}; {self.n_samples} samples>'

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return int(self.q.shape[1])

    @property
    def prismatic(self) -> BoolArray:
        """Which joints are prismatic, shape (n,); the others are revolute."""
        return is_prismatic(self.joint_types)

    def digest(self) -> str:
        """Return a hash of all that a fit depends on: samples, joints, gravity and low-pass."""
        joints = *self.joint_names, *self.joint_types
        return digest(
            self._recorded(),
            *(*joints, str(self.gravity_compensated)),
            *sorted(map(str, cutoffs_hz(self.provenance))),
        )

    @property
    def history(self) -> JointHistory:
        """What is known of the past of every sample."""
        return JointHistory(self.low_passed_sign, self.dahl_states)

    def covering(self, count: int) -> IndexArray:
        """
        Return the rows that cover positions, velocities and accelerations best.

        Farthest points in sine and cosine of revolute positions, prismatic positions, velocities
        and accelerations; fewer where the rest only repeats them.
        """
        angles, shifts = self.q[:, ~self.prismatic], self.q[:, self.prismatic]
        states = [np.sin(angles), np.cos(angles), shifts, self.dq, self.ddq]
        return farthest_points(np.concatenate(states, axis=1), count)

    def select(self, indices: ArrayLike) -> Dataset:
        """
        Return some samples by row numbers or a mask (N,), always in the order of time and once.

        Raises
        ------
        DataError
            If nothing is selected, or there is no such row.

        """
        try:
            chosen = np.asarray(indices)
            if chosen.ndim > 1 or np.ma.is_masked(indices):
                raise IndexError('these have several columns, or are masked')
            rows = np.unique(np.arange(self.n_samples)[chosen if chosen.size else []])
        except (IndexError, ValueError) as error:
            raise DataError(
                f'rows must be numbers below {self.n_samples} or a mask of so many values; '
                f'{error}.'
            ) from error
        if rows.size == 0:
            raise DataError(f'at least one of {self.n_samples} samples must be selected, not 0.')
        some = {name: array[rows] for name, array in self._arrays().items()}
        return dataclasses.replace(self, **some)

    def split(self, fraction: float) -> tuple[Dataset, Dataset]:
        """
        Cut into a first part in time, with a share of the samples between 0 and 1, and the rest.

        Raises
        ------
        DataError
            If one of the parts would be empty, or the share is no number.

        """
        if not isinstance(fraction, Real):
            raise DataError(f'the share of a split must be a number, not {shortened(fraction)}.')
        rows = np.arange(self.n_samples)
        cut = round(fraction * self.n_samples) if 0 < fraction < 1 else 0
        if not 0 < cut < self.n_samples:
            raise DataError(
                f'a share {fraction:g} of {self.n_samples} samples leaves one part of the split '
                'empty; choose one between 0 and 1 or use more samples.'
            )
        return self.select(rows[:cut]), self.select(rows[cut:])

    def with_joints(self, joint_names: Sequence[str]) -> Dataset:
        """Return the data set with its joints in this order; DataError if one is missing."""
        names = texts('joint_names', joint_names)
        missing = [name for name in names if name not in self.joint_names]
        if missing:
            raise DataError(missing_joints(missing, 'the data set', self.joint_names))
        columns = [self.joint_names.index(name) for name in names]
        values = {name: getattr(self, name) for name in PER_JOINT}
        some = {name: value[:, columns] for name, value in values.items() if value is not None}
        return dataclasses.replace(
            self,
            joint_names=names,
            joint_types=tuple(self.joint_types[column] for column in columns),
            **some,
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """
        Write the data set as npz, whole or not at all.

        Raises
        ------
        ConfigError
            If the path does not end in .npz.
        OSError
            If the file cannot be written.

        """
        require_suffix(path, formats.DATASET_SUFFIX, 'the data set')
        names = {'joint_names': self.joint_names, 'joint_types': self.joint_types}
        arrays = {**self._recorded(), **names}
        formats.write_npz(path, arrays, self.gravity_compensated, self.provenance)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """
        Read a data set: ours, or a bare npz file of q, dq, ddq and tau.

        What a bare file leaves out gets a default: `t` uniform steps of its scalar `dt`, of 1 s
        without one; `joint_names` joint_1, joint_2, ...; `joint_types` all revolute; `segment` a
        single one. One joint may be given as arrays of shape (N,). The provenance names what was
        filled in. Other arrays are ignored.

        Raises
        ------
        OSError
            If the file cannot be opened.
        SourceError
            If it is not a regular file.
        DataError
            If it is no data set, or contradicts itself; names the file.

        """
        fields = formats.read_npz(path)
        try:
            return cls(**fields)
        except DataError as error:
            raise type(error)(f'in {os.fspath(path)}, {error}') from error


def concatenate(datasets: Sequence[Dataset]) -> Dataset:
    """
    Join data sets of the same joints; segments and recordings of each get new numbers.

    Joints are matched by name, in the order of the first data set. True torques and energies are
    kept only where every data set has them; of the provenance, sources and copies.

    DataError if there is none, or joints, joint types or gravity compensation differ.
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
    copies = [each for data in ordered for each in data.provenance.get(COPIES, ())]
    return Dataset(
        **values,
        joint_names=first.joint_names,
        joint_types=first.joint_types,
        segment=_renumbered([data.segment for data in ordered]),
        recording=_renumbered([data.recording for data in ordered]),
        gravity_compensated=first.gravity_compensated,
        provenance={
            'sources': [source for data in ordered for source in _sources(data)],
            **({COPIES: copies} if copies else {}),
        },
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
