"""Inverse dynamics of an arm: what a fit learns, what a file keeps, and what predicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ShapeError
from lip_id_ros.kernels import TorquePosterior
from lip_id_ros.model import serialization
from lip_id_ros.model.checked_file import MODEL, read_checked, write_checked
from lip_id_ros.model.effort_calibration import EffortCalibration
from lip_id_ros.model.posterior_mean import FRICTION, GRAVITY, KINETIC, PosteriorMean
from lip_id_ros.model.torque_model import Prediction, Query, StandardDeviation

VERSION = 3


@dataclass(frozen=True, eq=False)
class InverseDynamicsModel:
    """
    Torques and energies of an arm, with their uncertainty.

    `query` and `predict` use working memory of the object: give each thread a copy of its own.

    Attributes
    ----------
    joint_names : tuple of str
        From base to tip.
    process : TorquePosterior
        Gaussian process posterior of torques and energies.
    potential_reference : array, shape (n,)
        Positions at which the potential energy is zero [rad or m].
    effort_calibrations : tuple of EffortCalibration
        One for each recording of the training data.
    summary : mapping
        JSON-able: a report of the fit.
    provenance : mapping
        JSON-able: where the data came from.

    """

    joint_names: tuple[str, ...]
    process: TorquePosterior
    potential_reference: Array
    effort_calibrations: tuple[EffortCalibration, ...]
    summary: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def joint_types(self) -> tuple[str, ...]:
        """'revolute' or 'prismatic', from base to tip."""
        return self.process.prior.kernel.basis.joint_types

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    @property
    def n_samples(self) -> int:
        """Number of samples N that the posterior is conditioned on."""
        return len(self.process.states)

    @property
    def kernel(self) -> str:
        """Name of the energy kernel, or 'articulated' where the model has rigid links."""
        return self.process.prior.kernel.name

    @property
    def noise_std(self) -> Array:
        """Standard deviation of each torque's measurement noise, shape (n,) [N m or N]."""
        return self.process.noise_std

    @property
    def has_potential(self) -> bool:
        """Whether the model has potential energy; not if the torques were gravity-compensated."""
        return self.process.prior.kernel.has_potential

    @property
    def size(self) -> int:
        """Number of numbers that the model keeps in order to predict."""
        states = self.process.states
        return states.q.size + states.dq.size + states.ddq.size + self.process.alpha.size

    @property
    def effort_calibration(self) -> EffortCalibration:
        """Calibration of the first recording."""
        return self.effort_calibrations[0]

    @cached_property
    def training_range(self) -> tuple[Array, Array]:
        """Lowest and highest q, dq, ddq of the training samples, each of shape (3, n)."""
        states = self.process.states
        stack = np.stack([states.q, states.dq, states.ddq])
        return stack.min(axis=1), stack.max(axis=1)

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        """
        Evaluate one joint state, without checks; the first call compiles.

        Parameters
        ----------
        q, dq, ddq : arrays, shape (n,)
            Positions [rad or m], velocities, accelerations.

        """
        parts, kinetic, potential = self._mean.one(q, dq, ddq)
        offset = self._potential_offset
        return Query(parts.sum(axis=0), kinetic, potential - offset, parts[GRAVITY])

    def predict(
        self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike, *, return_std: bool = False
    ) -> Prediction:
        """
        Evaluate N joint states.

        Parameters
        ----------
        q, dq, ddq : array-likes, shape (N, n)
        return_std : bool
            Whether to compute standard deviations; the first time factorises the Gram matrix.

        Raises
        ------
        ShapeError
            If the shapes are not (N, n) with the model's n.

        """
        x = self._checked(q, dq, ddq)
        parts, energies = self._mean.many(*x)
        inertial = self._mean.many(x[0], np.zeros_like(x[1]), x[2])[0][:, KINETIC]
        return Prediction(
            tau=parts.sum(axis=1),
            inertial=inertial,
            coriolis=parts[:, KINETIC] - inertial,
            gravity=parts[:, GRAVITY],
            friction=parts[:, FRICTION],
            kinetic=energies[:, 0],
            potential=energies[:, 1] - self._potential_offset if self.has_potential else None,
            std=self._standard_deviation(*x) if return_std else None,
        )

    def inertia_matrix(self, q: ArrayLike) -> Array:
        """
        Posterior mean of the inertia matrix, shape (N, n, n) [kg m^2, kg m or kg].

        Symmetric, but not guaranteed positive definite (docs/maths.md, section 9).

        Parameters
        ----------
        q : array-like, shape (N, n)

        Raises
        ------
        ShapeError
            If the shape is not (N, n) with the model's n.

        """
        (positions,) = self._checked(q)
        still = np.zeros_like(positions)
        units = (np.broadcast_to(unit, still.shape).copy() for unit in np.eye(self.n_joints))
        columns = [self._mean.many(positions, still, unit)[0][:, KINETIC] for unit in units]
        matrix = np.stack(columns, axis=-1)
        return np.asarray(0.5 * (matrix + matrix.transpose(0, 2, 1)))

    def coriolis(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Coriolis and centrifugal torques, shape (N, n) [N m or N]."""
        positions, velocities = self._checked(q, dq)
        return self._mean.many(positions, velocities, np.zeros_like(positions))[0][:, KINETIC]

    def gravity(self, q: ArrayLike) -> Array:
        """Gravity torques, shape (N, n) [N m or N]; zero where the model has no potential."""
        (positions,) = self._checked(q)
        still = np.zeros_like(positions)
        return self._mean.many(positions, still, still)[0][:, GRAVITY]

    def friction(self, dq: ArrayLike, q: ArrayLike | None = None) -> Array:
        """
        Torques of friction and of all that is not Lagrangian, shape (N, n) [N m or N].

        Parameters
        ----------
        dq : array-like, shape (N, n)
        q : array-like, shape (N, n), optional
            Positions, where friction depends on them or on the load; without them, the mean of
            the training positions.

        """
        (velocities,) = self._checked(dq)
        if q is None:
            q = np.broadcast_to(self.potential_reference, velocities.shape)
        positions, velocities = self._checked(q, dq)
        return self._mean.many(positions, velocities, np.zeros_like(positions))[0][:, FRICTION]

    def kinetic_energy(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Kinetic energy, shape (N,) [J]."""
        positions, velocities = self._checked(q, dq)
        return self._mean.many(positions, velocities, np.zeros_like(positions))[1][:, 0]

    def potential_energy(self, q: ArrayLike) -> Array:
        """Potential energy relative to the reference, shape (N,) [J]; nan without potential."""
        (positions,) = self._checked(q)
        still = np.zeros_like(positions)
        return self._mean.many(positions, still, still)[1][:, 1] - self._potential_offset

    def standard_deviation(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> StandardDeviation:
        """
        Posterior standard deviations at N joint states; the first call factorises the Gram matrix.

        Raises
        ------
        ShapeError
            If the shapes are not (N, n) with the model's n.

        """
        return self._standard_deviation(*self._checked(q, dq, ddq))

    def save(self, path: str | os.PathLike[str]) -> None:
        """
        Write the model into one npz file, whole or not at all.

        Raises
        ------
        OSError
            If the file cannot be written.

        """
        header = {
            'joint_names': list(self.joint_names),
            'potential_reference': self.potential_reference.tolist(),
            'effort_calibrations': serialization.calibrations_to_json(self.effort_calibrations),
            'process': serialization.process_to_json(self.process),
            'summary': dict(self.summary),
            'provenance': dict(self.provenance),
        }
        write_checked(path, MODEL, VERSION, serialization.process_to_arrays(self.process), header)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> InverseDynamicsModel:
        """
        Read a model.

        Raises
        ------
        OSError
            If the file does not exist or cannot be opened.
        ModelError
            If it is damaged, is no model, or comes from another version of the format.

        """
        arrays, header = read_checked(path, MODEL, VERSION)
        with serialization.contradictions(path):
            names = tuple(str(name) for name in header['joint_names'])
            return cls(
                joint_names=names,
                process=serialization.process_from(arrays, header['process'], len(names)),
                potential_reference=serialization.finite(header['potential_reference'], names),
                effort_calibrations=serialization.calibrations_from_json(
                    header['effort_calibrations'], names
                ),
                summary=header['summary'],
                provenance=header['provenance'],
            )

    @cached_property
    def _mean(self) -> PosteriorMean:
        return PosteriorMean(self.process)

    @cached_property
    def _potential_offset(self) -> float:
        if not self.has_potential:
            return np.nan
        still = np.zeros(self.n_joints)
        return self._mean.one(self.potential_reference, still, still)[2]

    def _standard_deviation(self, q: Array, dq: Array, ddq: Array) -> StandardDeviation:
        reference = self.potential_reference
        tau, kinetic, potential = map(np.sqrt, self.process.variances(q, dq, ddq, reference))
        return StandardDeviation(tau, kinetic, potential if self.has_potential else None)

    def _checked(self, *arrays: ArrayLike) -> list[Array]:
        # Copied, since numba would compile anew for arrays that are read-only or not contiguous.
        out = [np.array(x, dtype=np.float64, order='C') for x in arrays]
        for x in out:
            if x.ndim != 2 or x.shape != out[0].shape or x.shape[1] != self.n_joints:
                raise ShapeError(
                    f'joint states must have shape (N, {self.n_joints}), but one has {x.shape}; '
                    'pass one row per sample and one column per joint of the model.'
                )
        return out
