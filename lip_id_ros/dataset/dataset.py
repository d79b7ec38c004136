"""The data set: synchronous joint motions and torques, checked once and then read-only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import dataclasses
from dataclasses import dataclass, field
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.dataset import npz_file
from lip_id_ros.dataset.checks import (
    check_finite,
    check_joints,
    check_shapes,
    check_time,
    floats,
    integers,
    PER_JOINT,
    PER_SAMPLE,
)
from lip_id_ros.errors import DataError


@dataclass(frozen=True, kw_only=True, eq=False)
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
    tau_noiseless : ndarray, shape (N, n), optional
        True torques, known in simulation.
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
    tau_noiseless: Array | None = None
    kinetic: Array | None = None
    potential: Array | None = None
    gravity_compensated: bool = False
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Copy, check and lock every array."""
        for name in (*PER_SAMPLE, *PER_JOINT):
            if getattr(self, name) is not None:
                self._set(name, floats(name, getattr(self, name)))
        self._set('segment', integers('segment', self.segment))
        self._set('joint_names', tuple(str(name) for name in self.joint_names))
        self._set('joint_types', tuple(str(kind) for kind in self.joint_types))
        check_shapes(self)
        check_joints(self.joint_names, self.joint_types)
        check_finite(self)
        check_time(self.t, self.segment)

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    @property
    def n_samples(self) -> int:
        """Number of samples N."""
        return int(self.q.shape[0])

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return int(self.q.shape[1])

    def select(self, indices: ArrayLike) -> Dataset:
        """
        Return some samples, always in the order of time.

        Parameters
        ----------
        indices : array of int or of bool
            Row numbers (their order and repetition do not matter), or a mask of N values.

        Raises
        ------
        DataError
            If nothing is selected.

        """
        rows = np.unique(np.arange(self.n_samples)[np.asarray(indices)])
        if rows.size == 0:
            raise DataError(f'at least one of {self.n_samples} samples must be selected, not 0.')
        per_row = (*PER_SAMPLE, *PER_JOINT, 'segment')
        values = {name: getattr(self, name) for name in per_row}
        some = {name: value[rows] for name, value in values.items() if value is not None}
        return dataclasses.replace(self, **some)

    def split(self, fraction: float) -> tuple[Dataset, Dataset]:
        """
        Cut into a first and a remaining part in time.

        Parameters
        ----------
        fraction : float
            Share of samples in the first part, between 0 and 1.

        Raises
        ------
        DataError
            If one of the parts would be empty.

        """
        rows = np.arange(self.n_samples)
        cut = round(fraction * self.n_samples)
        if not 0 < cut < self.n_samples:
            raise DataError(
                f'a share {fraction:g} of {self.n_samples} samples leaves one part of the split '
                'empty; choose one between 0 and 1 or use more samples.'
            )
        return self.select(rows[:cut]), self.select(rows[cut:])

    def with_joints(self, joint_names: Sequence[str]) -> Dataset:
        """
        Return the data set with its joints chosen and ordered by name.

        Raises
        ------
        DataError
            If a joint is missing.

        """
        missing = [name for name in joint_names if name not in self.joint_names]
        if missing:
            raise DataError(
                f'joint {missing[0]!r} is not in the data set, which has '
                f'{", ".join(self.joint_names)}; name the joints as recorded.'
            )
        columns = [self.joint_names.index(name) for name in joint_names]
        values = {name: getattr(self, name) for name in PER_JOINT}
        some = {name: value[:, columns] for name, value in values.items() if value is not None}
        return dataclasses.replace(
            self,
            joint_names=tuple(joint_names),
            joint_types=tuple(self.joint_types[column] for column in columns),
            **some,
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """
        Write the data set as npz, whole or not at all.

        Raises
        ------
        OSError
            If the file cannot be written.

        """
        names = (*PER_SAMPLE, *PER_JOINT, 'segment', 'joint_names', 'joint_types')
        values = {name: getattr(self, name) for name in names}
        npz_file.write(path, values, self.gravity_compensated, self.provenance)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Dataset:
        """
        Read a data set, ours or a bare file of q, dq, ddq and tau.

        What a bare file leaves out gets a default: `t` uniform steps of its scalar `dt`, of 1 s
        without one; `joint_names` joint_1, joint_2, ...; `joint_types` all revolute; `segment` a
        single one. One joint may be given as arrays of shape (N,). The provenance names what was
        filled in. Other arrays are left aside.

        Raises
        ------
        OSError
            If the file cannot be opened.
        DataError
            If it is no data set, or contradicts itself; names the file.

        """
        fields = npz_file.read(path)
        try:
            return cls(**fields)
        except DataError as error:
            raise type(error)(f'in {os.fspath(path)}, {error}') from error
