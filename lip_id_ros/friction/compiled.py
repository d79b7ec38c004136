"""Friction in compiled form, for the query of single states: sums of primitives."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import compress
import math
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.friction.dahl import Dahl
from lip_id_ros.friction.drives import Drive
from lip_id_ros.friction.model import FrictionBasis, FrictionModel
from lip_id_ros.friction.primitives import (
    ACCELERATION,
    ANYWHERE,
    LEVER,
    LOAD,
    ONE,
    POSITION,
    Primitive,
    REVERSAL,
    SIGN,
    SINE,
    STEP,
    STEP_AT,
    VELOCITY,
)
from lip_id_ros.joint_types import JointHistory, UNKNOWN
from lip_id_ros.numba_jit import jit, jit_inlined, jit_reading


class CompiledFriction(NamedTuple):
    """Friction of m drives of n joints as a sum of p primitives, ordered by drive."""

    ratios: Array
    shares: Array
    rise_time: Array
    bearing: IntArray
    ends: IntArray
    shape: IntArray
    side: IntArray
    position: IntArray
    width: Array
    harmonic: Array
    acceleration: Array
    centre: Array
    factor: Array
    loaded: BoolArray

    @classmethod
    def of(cls, friction: FrictionModel) -> CompiledFriction:
        """Compile friction; terms with coefficients of zero cost nothing."""
        drives = [(drive, sorted(p.items())) for drive, p in _factors(friction).items()]
        return _laid_out(drives, friction.n_joints, friction.basis.rise_time)

    @classmethod
    def features_of(cls, basis: FrictionBasis) -> CompiledFriction:
        """Compile the features of a basis, each as a drive of its own with a coefficient of 1."""
        columns = [
            (part.drive, [(primitive, factor) for factor, primitive in column])
            for part in basis.terms
            for column in part.term.columns()
        ]
        return _laid_out(columns, basis.n_joints, basis.rise_time)


def _laid_out(
    drives: Sequence[tuple[Drive, Sequence[tuple[Primitive, float]]]],
    n_joints: int,
    rise_time: float,
) -> CompiledFriction:
    """Lay the primitives of drives out in arrays, with the factor of each."""
    ratios, shares = np.zeros((2, len(drives), n_joints))
    for k, (drive, _) in enumerate(drives):
        ratios[k, list(drive.joints)] = drive.ratios
        for joint, share in drive.efforts:
            shares[k, joint] = share
    sizes = [len(parts) for _, parts in drives]
    every = [part for _, parts in drives for part in parts]
    primitives = [primitive for primitive, _ in every]
    return CompiledFriction(
        ratios,
        shares,
        np.full(len(drives), rise_time),
        np.array([drive.joints[0] for drive, _ in drives], dtype=np.int64),
        np.cumsum(sizes, dtype=np.int64),
        np.array([each.shape for each in primitives], dtype=np.int64),
        np.array([each.side for each in primitives], dtype=np.int64),
        np.array([each.position for each in primitives], dtype=np.int64),
        np.array([each.width for each in primitives], dtype=np.float64),
        np.array([each.harmonic for each in primitives], dtype=np.float64),
        np.array([each.acceleration for each in primitives], dtype=np.float64),
        np.array([each.centre for each in primitives], dtype=np.float64),
        np.array([factor for _, factor in every], dtype=np.float64),
        np.array([each.loaded for each in primitives], dtype=np.bool_),
    )


def _factors(friction: FrictionModel) -> dict[Drive, dict[Primitive, float]]:
    """Sum the factors of equal primitives of each drive."""
    drives: dict[Drive, dict[Primitive, float]] = defaultdict(lambda: defaultdict(float))
    basis = friction.basis
    for part, place in zip(basis.terms, basis.slices, strict=True):
        columns = zip(part.term.columns(), friction.coefficients[place], strict=True)
        for column, coefficient in columns:
            for factor, primitive in column:
                if coefficient != 0.0:
                    drives[part.drive][primitive] += factor * coefficient
    return drives


@jit
def add_friction(
    friction: CompiledFriction, q: Array, dq: Array, ddq: Array, load: Array, out: Array
) -> None:
    """
    Add the friction torques of one state to `out`, which is another array than `load`.

    All have shape (n,); load and result are torques or forces of the links on the joints [N m or
    N].
    """
    first = 0
    for m in range(len(friction.ends)):
        torque = _torque_of_drive(friction, m, first, q, dq, ddq, load[friction.bearing[m]], 0.0)
        first = friction.ends[m]
        for j in range(len(q)):
            out[j] += friction.shares[m, j] * torque


@jit
def set_features(
    features: CompiledFriction,
    q: Array,
    dq: Array,
    ddq: Array,
    load: Array,
    seen: Array,
    out: Array,
) -> None:
    """
    Set the features (n, K) of friction at one state, by `CompiledFriction.features_of`.

    `seen`, shape (K,), is the discrepancy of the sign of each feature's drive, as in `DriveState`.
    """
    first = 0
    for k in range(len(features.ends)):
        bearing = load[features.bearing[k]]
        feature = _torque_of_drive(features, k, first, q, dq, ddq, bearing, seen[k])
        first = features.ends[k]
        for j in range(len(q)):
            out[j, k] = features.shares[k, j] * feature


@jit
def set_load_slopes(
    features: CompiledFriction,
    loaded: IndexArray,
    coefficients: Array,
    q: Array,
    dq: Array,
    ddq: Array,
    load: Array,
    out: Array,
) -> None:
    """
    Differentiate the friction torques of one state by the loads, as `load_slopes` does for many.

    Features are those of `CompiledFriction.features_of`; `loaded` numbers those that depend on a
    load. `out` has shape (n, n).
    """
    out[:] = 0.0
    for k in loaded:
        bearing = features.bearing[k]
        sign = -1.0 if load[bearing] < 0.0 else 1.0
        first = features.ends[k - 1] if k > 0 else 0
        change = _torque_of_drive(features, k, first, q, dq, ddq, sign, 0.0)
        change -= _torque_of_drive(features, k, first, q, dq, ddq, 0.0, 0.0)
        for j in range(len(q)):
            out[j, bearing] += features.shares[k, j] * coefficients[k] * sign * change


@jit_reading
def _features(
    features: CompiledFriction, q: Array, dq: Array, ddq: Array, load: Array, seen: Array
) -> Array:
    out = np.empty((*q.shape, len(features.ends)))
    for t in range(len(q)):
        set_features(features, q[t], dq[t], ddq[t], load[t], seen[t], out[t])
    return out


class FrictionFeatures:
    """The features of friction of a basis, compiled once for many calls."""

    def __init__(self, basis: FrictionBasis) -> None:
        self._basis, self._compiled = basis, CompiledFriction.features_of(basis)
        signs = [
            each.drive.signs(basis.n_joints) for each in basis.terms for _ in range(each.size)
        ]
        self._signs = np.array(signs).reshape(-1, basis.n_joints).T

    def __call__(
        self, q: Array, dq: Array, ddq: Array, load: Array, history: JointHistory = UNKNOWN
    ) -> Array:
        """Return the features (N, n, K) for all torques, as `FrictionBasis.features`."""
        basis = self._basis
        discrepancy = basis.discrepancy(dq, ddq, history.sign)
        seen = discrepancy @ self._signs
        states = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq, load, seen))
        out = _features(self._compiled, *states)
        if history.dahl is not None:
            for part, place in zip(basis.terms, basis.slices, strict=True):
                if isinstance(part.term, Dahl):
                    state = part.drive.state(
                        q, dq, ddq, load, basis.rise_time, discrepancy, history.dahl
                    )
                    out[:, part.drive.joints[0], place] = part.term.features(state)
        return np.asarray(out)

    def load_slopes(
        self,
        coefficients: Array,
        q: Array,
        dq: Array,
        ddq: Array,
        load: Array,
        history: JointHistory = UNKNOWN,
    ) -> Array:
        """
        Differentiate the torques by the loads: of joint i by load j, shape (N, n, n).

        Every term is affine in a load of one sign, so that a unit of load shows the slope.

        """
        slopes = np.zeros((*load.shape, self._basis.n_joints))
        loaded, own = self._loaded
        if loaded is None:
            return slopes
        sign = np.where(load < 0.0, -1.0, 1.0)  # a feature has one load
        change = loaded(q, dq, ddq, sign, history)
        change -= loaded(q, dq, ddq, np.zeros_like(load), history)
        bearing = loaded._compiled.bearing
        change *= coefficients[own] * sign[:, bearing][:, None]
        for k, joint in enumerate(bearing):
            slopes[:, :, joint] += change[:, :, k]
        return slopes

    @cached_property
    def _loaded(self) -> tuple[FrictionFeatures | None, IndexArray]:
        """The features of the terms that depend on a load, and their numbers."""
        basis = self._basis
        kept = [bool(basis.is_loaded[place].any()) for place in basis.slices]
        terms = tuple(compress(basis.terms, kept))
        own = [np.arange(basis.size)[place] for place in compress(basis.slices, kept)]
        features = FrictionFeatures(replace(basis, terms=terms)) if terms else None
        return features, np.concatenate([np.zeros(0, np.intp), *own])


def friction_features(
    basis: FrictionBasis,
    q: Array,
    dq: Array,
    ddq: Array,
    load: Array,
    history: JointHistory = UNKNOWN,
) -> Array:
    """Return the features (N, n, K) of friction for all torques, as `FrictionBasis.features`."""
    return FrictionFeatures(basis)(q, dq, ddq, load, history)


@jit_inlined
def _torque_of_drive(
    friction: CompiledFriction,
    m: int,
    first: int,
    q: Array,
    dq: Array,
    ddq: Array,
    load: float,
    discrepancy: float,
) -> float:
    position = speed = change = 0.0
    for j in range(len(q)):
        ratio = friction.ratios[m, j]
        position += ratio * q[j]
        speed += ratio * dq[j]
        change += ratio * ddq[j]
    smoothing = friction.rise_time[m] * change
    return drive_friction(
        friction, first, friction.ends[m], position, speed, change, load, smoothing, discrepancy
    )


@jit_inlined
def drive_friction(
    friction: CompiledFriction,
    first: int,
    end: int,
    q: float,
    dq: float,
    ddq: float,
    load: float,
    smoothing: float,
    discrepancy: float,
) -> float:
    """Return the friction torque of one drive, whose state is a `DriveState`."""
    torque = 0.0
    width, sign, share = -1.0, 0.0, 0.0
    for p in range(first, end):
        shape = friction.shape[p]
        if shape == ONE:
            value = 1.0
        elif shape == VELOCITY:
            value = dq
        elif shape in (SIGN, REVERSAL):
            if friction.width[p] != width:  # primitives of one width follow each other
                width = friction.width[p]
                square = width * width + smoothing * smoothing
                sign = _tanh(dq / math.sqrt(square))
                share = smoothing * smoothing / square
            value = sign + discrepancy * share
            if shape == REVERSAL:
                value = (1.0 - sign * sign) * _tanh(ddq / friction.acceleration[p])
        elif shape == STEP:
            value = _tanh((dq - friction.centre[p]) / friction.width[p])
        elif shape == LOAD:
            value = load
        elif shape == ACCELERATION:
            value = ddq
        else:
            value = dq * abs(dq)
        if friction.side[p] * value < 0.0:
            value = 0.0
        if friction.loaded[p]:
            value *= abs(load)
        if friction.position[p] != ANYWHERE:
            value *= _of_position(
                friction.position[p], q - friction.centre[p], friction.harmonic[p]
            )
        torque += friction.factor[p] * value
    return torque


@jit_inlined
def _tanh(x: float) -> float:
    """Return tanh(x) to an absolute error of 1e-16, in a third of the time of `np.tanh`."""
    return 1.0 - 2.0 / (1.0 + math.exp(2.0 * x))


@jit_inlined
def _of_position(position: int, q: float, harmonic: float) -> float:
    if position == POSITION:
        return q
    if position == STEP_AT:
        return _tanh(harmonic * q)
    if position == SINE:
        return math.sin(harmonic * q)
    if position == LEVER:
        return math.sin(q) / math.sqrt(1.0 - harmonic * math.cos(q))
    return math.cos(harmonic * q)
