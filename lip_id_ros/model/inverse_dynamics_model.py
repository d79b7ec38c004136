"""Inverse dynamics of an arm: what a fit learns, what a file keeps, and what predicts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
import json
import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lip_id_ros.arrays import Array, BoolArray, digest, EVERY, Rows
from lip_id_ros.checked_file import Arrays, read_checked, write_checked
from lip_id_ros.errors import ShapeError
from lip_id_ros.friction.dahl import (
    begins_of_states,
    begins_of_times,
    dahl_states,
    Steps,
    unknown_share,
)
from lip_id_ros.friction.dahl_friction import DahlFriction, RunningMemory
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.kernels import TorquePosterior
from lip_id_ros.model import serialization
from lip_id_ros.model.arm_deviation import ArmDeviation
from lip_id_ros.model.arm_mean import ArmMean
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.effort_calibration import EffortCalibration
from lip_id_ros.model.known_states import KnownStates
from lip_id_ros.model.process_mean import ProcessMean
from lip_id_ros.model.residual_gp import ResidualGP
from lip_id_ros.model.residual_gp_deviation import ResidualGPDeviation
from lip_id_ros.model.torque_model import Parts, Prediction, Query, StandardDeviation

VERSION, READ = 8, (7, 8)
"""Of model files: what is written, and what can be read; 7 knows no coupled positions."""

ARTICULATED = 'articulated'
"""Name of the kernel of a model that is an arm."""


@dataclass(frozen=True, eq=False, repr=False)
class InverseDynamicsModel:
    """
    Torques and energies of an arm, with their uncertainty.

    Either an arm, whose torques may have a residual GP, or a Gaussian process on energies.
    `query` and `predict` use working memory of the object: give each thread a copy of its own.

    Attributes
    ----------
    joint_names : tuple of str
        From base to tip.
    joint_types : tuple of str
        'revolute' or 'prismatic'.
    potential_reference : array, shape (n,)
        Positions at which the potential energy is zero [rad or m].
    training_range : tuple of two arrays, shape (3, n)
        Lowest and highest q, dq, ddq of the training samples.
    largest_torque : array, shape (n,)
        Of the training samples [N m or N].
    n_samples : int
        Number of training samples that the posterior has taken in.
    effort_calibrations : tuple of EffortCalibration
        One for each recording of the training data.
    arm : ArmPosterior or None
        Chain, links and friction.
    residual_gp : ResidualGP or None
        Gaussian processes of torques that the arm does not explain.
    process : TorquePosterior or None
        Gaussian processes on energies, friction and residual, in place of an arm.
    known_states : KnownStates or None
        Training states that cover the others; None in files that were written without.
    summary : mapping
        JSON-able: a report of the fit.
    provenance : mapping
        JSON-able: where the data came from.

    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    potential_reference: Array
    training_range: tuple[Array, Array]
    largest_torque: Array
    n_samples: int
    effort_calibrations: tuple[EffortCalibration, ...]
    arm: ArmPosterior | None = None
    residual_gp: ResidualGP | None = None
    process: TorquePosterior | None = None
    known_states: KnownStates | None = None
    summary: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        joints = ', '.join(self.joint_names)
        return f'<{self.kernel} model of {joints}; {self.n_samples} training samples>'

    def __getstate__(self) -> dict[str, Any]:
        """Return what is copied: no working memory, so that each copy makes its own."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    @property
    def kernel(self) -> str:
        """Name of the energy kernel; 'articulated' where the model is an arm."""
        return self.process.prior.kernel.energy.name if self.process else ARTICULATED

    @property
    def noise_std(self) -> Array:
        """Standard deviation of the noise of a measured torque in motion, (n,) [N m or N]."""
        return self._known_arm.noise.std if self.process is None else self.process.noise_std

    @cached_property
    def has_potential(self) -> bool:
        """Whether the model has potential energy; not if the torques were gravity-compensated."""
        if self.process is not None:
            return self.process.prior.kernel.has_potential
        return bool(self._known_arm.chain.gravity.any())

    @property
    def size(self) -> int:
        """Number of numbers that the model keeps in order to predict."""
        return int(sum(values.size for values in self._contents()[0].values()))

    @property
    def effort_calibration(self) -> EffortCalibration:
        """Calibration of the first recording."""
        return self.effort_calibrations[0]

    @property
    def rise_time(self) -> float:
        """Time over which friction turns, as after the low-pass of the fitted efforts [s]."""
        return 0.0 if self.arm is None else self.arm.friction.basis.rise_time

    def with_rise_time(self, rise_time: float) -> InverseDynamicsModel:
        """
        Return the model with friction that turns over another time [s].

        That of drives turns at once: feedforward with a rise time of zero tracks better.
        """
        if rise_time == self.rise_time:
            return self
        arm = self._known_arm
        return replace(self, arm=replace(arm, friction=arm.friction.with_rise_time(rise_time)))

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        """
        Evaluate one joint state, without checks; the first call compiles.

        Friction with a memory is that of an unknown past: `running_memory` has the rest.

        Parameters
        ----------
        q, dq, ddq : arrays, shape (n,)
            Positions [rad or m], velocities, accelerations.

        """
        tau, gravity, kinetic, potential = self._mean.one(q, dq, ddq)
        return Query(tau, kinetic, potential - self._potential_offset, gravity)

    def predict(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        t: ArrayLike | None = None,
        *,
        return_std: bool = False,
    ) -> Prediction:
        """
        Evaluate N joint states.

        Where friction has a memory (Dahl), rows that continue one another are one motion, whose
        past is known; other rows are single states.

        Parameters
        ----------
        q, dq, ddq : array-likes, shape (N, n)
        t : array-like, shape (N,), optional
            Times [s]; a motion ends where they go back, or forward by more than 0.5 s. Without
            them it ends where a row does not follow from the velocities of the one before.
        return_std : bool
            Whether to compute standard deviations: of noiseless and of measured torques, and of
            both energies.

        Raises
        ------
        ShapeError
            If the shapes are not (N, n) with the model's n.

        """
        x = self._checked(q, dq, ddq)
        parts = self._mean.many(*x)
        steps = None if self._memory is None else self._steps(x, t)
        if self._memory is not None and steps is not None:
            remembered = self._memory.torque(x[1], x[2], dahl_states(steps))
            parts.tau[:] += remembered
            parts.friction[:] += remembered
        potential = parts.potential - self._potential_offset if self.has_potential else None
        std = self._standard_deviation(x, t, EVERY) if return_std else None
        return Prediction(**{**parts._asdict(), 'potential': potential}, std=std)

    def inertia_matrix(self, q: ArrayLike) -> Array:
        """
        Posterior mean of the inertia matrix, shape (N, n, n) [kg m^2, kg m or kg].

        Symmetric; positive definite for an arm, by construction, but not guaranteed for Gaussian
        processes (maths.md, section 9).

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
        matrix = np.stack([self._mean.many(positions, still, u).inertial for u in units], axis=-1)
        return np.asarray(0.5 * (matrix + matrix.transpose(0, 2, 1)))

    def coriolis(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Coriolis and centrifugal torques, shape (N, n) [N m or N]."""
        return self._unaccelerated(q, dq).coriolis

    def gravity(self, q: ArrayLike) -> Array:
        """Gravity torques, shape (N, n) [N m or N]; zero where the model has no potential."""
        return self._at_rest(q).gravity

    def friction(self, dq: ArrayLike, q: ArrayLike | None = None) -> Array:
        """
        Torques of friction and of all that is not Lagrangian, shape (N, n) [N m or N].

        At constant velocity: `predict` has that of reversals too (pre-sliding).

        Parameters
        ----------
        dq : array-like, shape (N, n)
        q : array-like, shape (N, n), optional
            Positions, where friction depends on them or on the load; without them, the mean of
            the training positions.

        """
        if q is None:
            (velocities,) = self._checked(dq)
            q = np.broadcast_to(self.potential_reference, velocities.shape)
        return self._unaccelerated(q, dq).friction

    def efforts(self, torque: Array) -> Array:
        """Return the efforts for torques of joints (..., n), those of motors where coupled."""
        return torque if self.arm is None else self.arm.friction.efforts(torque)

    def kinetic_energy(self, q: ArrayLike, dq: ArrayLike) -> Array:
        """Kinetic energy, shape (N,) [J]."""
        return self._unaccelerated(q, dq).kinetic

    def potential_energy(self, q: ArrayLike) -> Array:
        """Potential energy relative to the reference, shape (N,) [J]; nan without potential."""
        return self._at_rest(q).potential - self._potential_offset

    def _at_rest(self, q: ArrayLike) -> Parts:
        (positions,) = self._checked(q)
        return self._unaccelerated(positions, np.zeros_like(positions))

    def _unaccelerated(self, q: ArrayLike, dq: ArrayLike) -> Parts:
        positions, velocities = self._checked(q, dq)
        return self._mean.many(positions, velocities, np.zeros_like(positions))

    def standard_deviation(
        self,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        t: ArrayLike | None = None,
        *,
        rows: Rows = EVERY,
    ) -> StandardDeviation:
        """
        Posterior standard deviations at N joint states, whose past is known as for `predict`.

        Of these, only those at some `rows` are computed, and the others are their past.

        The first call for a Gaussian process on energies factorises its Gram matrix.

        Raises
        ------
        ShapeError
            If the shapes are not (N, n) with the model's n.

        """
        return self._standard_deviation(self._checked(q, dq, ddq), t, rows)

    def _standard_deviation(
        self, states: Sequence[Array], t: ArrayLike | None, rows: Rows
    ) -> StandardDeviation:
        at, rate, change = (x[rows] for x in states)
        if self.process is not None:
            variances = self.process.variances(at, rate, change, self.potential_reference)
            tau, kinetic, potential = map(np.sqrt, variances)
            measured = np.hypot(tau, self.process.noise_std)
        else:
            tau = self.torque_std(states[0], states[1], states[2], t, rows=rows)
            measured = self._known_arm.noise.measured_std(tau, rate)
            kinetic, potential = self._arm_deviation.energy_std(at, rate)
        known = potential if self.has_potential else None
        return StandardDeviation(tau, measured, kinetic, known)

    def novelty(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """
        Return how far N joint states are from the training data, shape (N,).

        1 is as far as left-out training states in motion were from the rest, 2 is twice as far. It
        orders motions, not single samples; not a number where the file has no training states.

        Raises
        ------
        ShapeError
            If the shapes are not (N, n) with the model's n.

        """
        states = self._checked(q, dq, ddq)
        if self.known_states is None:
            return np.full(len(states[0]), np.nan)
        return self.known_states.novelty(*states)

    def save(self, path: str | os.PathLike[str]) -> None:
        """
        Write the model into one npz file, whole or not at all.

        Raises
        ------
        OSError
            If the file cannot be written.

        """
        arrays, header = self._contents()
        write_checked(path, VERSION, arrays, header)

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
        arrays, header = read_checked(path, READ)
        with serialization.contradictions(path):
            names = tuple(str(name) for name in header['joint_names'])
            types = serialization.joint_types(header['joint_types'], names)
            serialization.of_present_format(arrays, header)
            return cls(
                joint_names=names,
                joint_types=types,
                potential_reference=serialization.finite(header['potential_reference'], types),
                training_range=serialization.training_range(arrays, types),
                largest_torque=serialization.finite(header['largest_torque'], types),
                n_samples=int(header['n_samples']),
                effort_calibrations=serialization.calibrations_from_json(
                    header['effort_calibrations'], types
                ),
                **{name: header[name] for name in ('summary', 'provenance')},
                known_states=serialization.known_states_from(arrays, types),
                **serialization.parts_from(arrays, header, types),
            )

    def _contents(self) -> tuple[Arrays, dict[str, Any]]:
        """Return the arrays and the header of the model's file."""
        low, high = self.training_range
        arrays: Arrays = {'training_low': low, 'training_high': high}
        entries = serialization.put_parts(self.arm, self.residual_gp, self.process, arrays)
        serialization.put_known_states(self.known_states, arrays)
        return arrays, {
            'joint_names': list(self.joint_names),
            'joint_types': list(self.joint_types),
            'potential_reference': self.potential_reference.tolist(),
            'largest_torque': self.largest_torque.tolist(),
            'n_samples': self.n_samples,
            'effort_calibrations': serialization.calibrations_to_json(self.effort_calibrations),
            **entries,
            'summary': dict(self.summary),
            'provenance': dict(self.provenance),
        }

    @property
    def _known_arm(self) -> ArmPosterior:
        assert self.arm is not None, 'a model is an arm or a process'
        return self.arm

    def running_memory(self) -> RunningMemory | None:
        """Return what friction with a memory adds to `query` along a stream; None without one."""
        return None if self._memory is None else RunningMemory(self._memory, self._revolute)

    @cached_property
    def fingerprint(self) -> str:
        """A hash of all that a file of the model holds."""
        arrays, header = self._contents()
        return digest(arrays, json.dumps(header, sort_keys=True))

    @cached_property
    def _memory(self) -> DahlFriction | None:
        """Friction that depends on the history, but for joints with a process in its place."""
        if self.arm is None:
            return None
        memory = DahlFriction.of(self.arm.friction, self._replaced)
        return memory if memory.joint.size else None

    @cached_property
    def _replaced(self) -> BoolArray:
        """Joints with a process in the place of links and friction, shape (n,)."""
        if self.residual_gp is None:
            return np.zeros(self.n_joints, dtype=np.bool_)
        return np.asarray(self.residual_gp.replaces, dtype=np.bool_)

    @cached_property
    def _revolute(self) -> BoolArray:
        return np.asarray(~is_prismatic(self.joint_types))

    def _steps(self, states: Sequence[Array], t: ArrayLike | None) -> Steps | None:
        """Return the displacements of rows q, dq, ddq; None where they are single states."""
        begins = _begins(states, t, self._revolute)
        if begins is None:
            return None
        return Steps.of(states[0], states[1], begins, self._revolute)

    @cached_property
    def _mean(self) -> ArmMean | ProcessMean:
        if self.process is not None:
            return ProcessMean(self.process)
        arm = self._known_arm
        return ArmMean(arm, arm.friction.compiled, self.residual_gp)

    @cached_property
    def _arm_deviation(self) -> ArmDeviation:
        return ArmDeviation(self._known_arm, self.potential_reference)

    @cached_property
    def _residual_gp_deviation(self) -> ResidualGPDeviation:
        assert self.residual_gp is not None, 'only a residual GP has deviations of its own'
        return ResidualGPDeviation(self.residual_gp)

    @cached_property
    def _potential_offset(self) -> float:
        if not self.has_potential:
            return np.nan
        return self._mean.one(self.potential_reference, *np.zeros((2, self.n_joints)))[3]

    def torque_std(
        self,
        q: Array,
        dq: Array,
        ddq: Array,
        t: ArrayLike | None = None,
        *,
        rows: Rows = EVERY,
    ) -> Array:
        """Return deviations of noiseless torques at `rows` of (N, n), no checks [N m or N]."""
        some = q[rows], dq[rows], ddq[rows]
        if self.process is not None:
            return np.sqrt(self.process.variances(*some, self.potential_reference)[0])
        std = self._arm_deviation.torque_std(*some)
        if self.residual_gp is not None:
            self._residual_gp_deviation.add_to(std, *some)
        if self._memory is not None:
            steps = self._steps((q, dq, ddq), t)
            if steps is None:
                unknown = self._memory.single_std(some[1], some[2])
            else:
                unknown = self._memory.unknown_std(unknown_share(steps)[rows])
            std = np.hypot(std, unknown)
        return std

    def _checked(self, *arrays: ArrayLike) -> list[Array]:
        # Copied, since numba would compile anew for arrays that are read-only or not contiguous.
        try:
            out = [np.array(_numbers(x), dtype=np.float64, order='C') for x in arrays]
        except (TypeError, ValueError) as error:
            raise ShapeError(
                f'joint states must be arrays of numbers with rows of equal length; {error}.'
            ) from error
        for x in out:
            if x.ndim != 2 or x.shape != out[0].shape or x.shape[1] != self.n_joints:
                raise ShapeError(
                    f'joint states must have shape (N, {self.n_joints}), but one has {x.shape}; '
                    'pass one row per sample and one column per joint of the model.'
                )
        return out


def _begins(states: Sequence[Array], t: ArrayLike | None, revolute: BoolArray) -> BoolArray | None:
    """Mark the rows of states q, dq, ddq that do not continue the one before, shape (N,)."""
    if t is None:
        q, dq, ddq = states
        return begins_of_states(q, dq, ddq, revolute)
    try:
        times = _numbers(t).astype(np.float64)
    except (TypeError, ValueError) as error:
        raise ShapeError(f't must be an array of numbers; {error}.') from error
    if times.shape != states[0].shape[:1]:
        raise ShapeError(
            f't must have shape {states[0].shape[:1]} like the rows of q, not {times.shape}.'
        )
    return begins_of_times(times, np.zeros(len(times)))


def _numbers(values: ArrayLike) -> NDArray[Any]:
    array = np.asarray(values)
    if array.dtype.kind not in 'iuf':
        raise TypeError(f'one has values of type {array.dtype}')
    if np.ma.is_masked(values):
        raise TypeError('one has masked values')
    return array
