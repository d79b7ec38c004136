"""Torques and energies of a trained model, fast enough for a controller."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ShapeError
from lip_id_ros.model import Prediction, Query, StandardDeviation, TrainedModel
from lip_id_ros.serving.contraction import new_scratch
from lip_id_ros.serving.evaluator import (
    contract,
    evaluate_many,
    evaluate_one,
    FRICTION,
    GRAVITY,
    INERTIAL_AND_CORIOLIS,
)
from lip_id_ros.serving.uncertainty import Uncertainty


class Predictor:
    """
    Posterior of a trained model.

    Construction lays the model out and compiles; `query` is then hot: no checks, and nothing
    allocated but the result. Not for several threads at once: give each its own.

    Parameters
    ----------
    model : TrainedModel

    """

    def __init__(self, model: TrainedModel) -> None:
        self.model = model
        self._contracted = contract(model)
        n = model.n_joints
        self._work = new_scratch(self._contracted.k)
        self._features = np.empty((4, n))
        self._parts = np.empty((3, n))
        self._energies = np.empty(2)
        self._state = np.zeros((3, n))
        self._potential_offset = 0.0
        self._potential_offset = self._reference_potential()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints from base to tip."""
        return self.model.joint_names

    @property
    def joint_types(self) -> tuple[str, ...]:
        """'revolute' or 'prismatic', per joint."""
        return self.model.joint_types

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return self.model.n_joints

    @property
    def has_potential(self) -> bool:
        """Whether the model predicts potential energy."""
        return self.model.has_potential

    @property
    def size(self) -> int:
        """Number of numbers that the model keeps in order to predict."""
        states = self.model.states
        return states.q.size + states.dq.size + states.ddq.size + self.model.alpha.size

    @property
    def noise_std(self) -> Array:
        """Standard deviation of the measured torques' noise, shape (n,) [N m or N]."""
        return self.model.noise_std

    @cached_property
    def training_range(self) -> tuple[Array, Array]:
        """Lowest and highest q, dq, ddq of the training samples, each of shape (3, n)."""
        states = self.model.states
        stack = np.stack([states.q, states.dq, states.ddq])
        return stack.min(axis=1), stack.max(axis=1)

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        """
        Evaluate one joint state, without checks.

        Parameters
        ----------
        q, dq, ddq : arrays, shape (n,)
            Positions [rad or m], velocities, accelerations.

        """
        parts, energies, state = self._parts, self._energies, self._state
        # Copied, since numba would compile anew for arrays that are read-only or not contiguous.
        state[0], state[1], state[2] = q, dq, ddq
        evaluate_one(parts, energies, *self._contracted, self._work, self._features, *state)
        return Query(
            parts[0] + parts[1] + parts[2],
            float(energies[0]),
            float(energies[1] - self._potential_offset),
            parts[GRAVITY].copy(),
        )

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
        parts, energies = self._evaluate(*x)
        inertial = self._evaluate(x[0], np.zeros_like(x[1]), x[2])[0][:, INERTIAL_AND_CORIOLIS]
        potential = energies[:, 1] - self._potential_offset
        return Prediction(
            tau=parts.sum(axis=1),
            inertial=inertial,
            coriolis=parts[:, INERTIAL_AND_CORIOLIS] - inertial,
            gravity=parts[:, GRAVITY],
            friction=parts[:, FRICTION],
            kinetic=energies[:, 0],
            potential=potential if self.model.has_potential else None,
            std=self._uncertainty.standard_deviation(*x) if return_std else None,
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
        columns = []
        for j in range(self.n_joints):
            unit = still.copy()
            unit[:, j] = 1.0
            columns.append(self._evaluate(positions, still, unit)[0][:, INERTIAL_AND_CORIOLIS])
        matrix = np.stack(columns, axis=-1)
        return 0.5 * (matrix + matrix.transpose(0, 2, 1))

    def standard_deviation(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> StandardDeviation:
        """
        Posterior standard deviations at N joint states; the first call factorises the Gram matrix.

        Raises
        ------
        ShapeError
            If the shapes are not (N, n) with the model's n.

        """
        return self._uncertainty.standard_deviation(*self._checked(q, dq, ddq))

    @cached_property
    def _uncertainty(self) -> Uncertainty:
        return Uncertainty(self.model)

    def _reference_potential(self) -> float:
        # Also where there is none: the first query compiles.
        still = np.zeros(self.n_joints)
        if not self.model.has_potential:
            self.query(still, still, still)
            return np.nan
        return self.query(self.model.potential_reference, still, still).potential

    def _evaluate(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        parts = np.empty((len(q), 3, self.n_joints))
        energies = np.empty((len(q), 2))
        work, features = new_scratch(self._contracted.k), np.empty((4, self.n_joints))
        evaluate_many(parts, energies, *self._contracted, work, features, q, dq, ddq)
        return parts, energies

    def _checked(self, *arrays: ArrayLike) -> list[Array]:
        # Copied for the reason in `query`.
        out = [np.array(x, dtype=np.float64, order='C') for x in arrays]
        for x in out:
            if x.ndim != 2 or x.shape != out[0].shape or x.shape[1] != self.n_joints:
                raise ShapeError(
                    f'joint states must have shape (N, {self.n_joints}), but one has {x.shape}; '
                    'pass one row per sample and one column per joint of the model.'
                )
        return out
