"""Friction of drives as sums of primitives, compiled."""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.friction.drives import Drive
from lip_id_ros.friction.primitives import (
    ACCELERATION,
    ANYWHERE,
    Column,
    LEVER,
    LOAD,
    ONE,
    POSITION,
    REVERSAL,
    SIGN,
    SINE,
    STEP,
    STEP_AT,
    VELOCITY,
)
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
    def of(
        cls, drives: Sequence[tuple[Drive, Column]], n_joints: int, rise_time: float
    ) -> CompiledFriction:
        """Lay the primitives of drives out in arrays, with the factor of each."""
        ratios, shares = np.zeros((2, len(drives), n_joints))
        for k, (drive, _) in enumerate(drives):
            ratios[k, list(drive.joints)] = drive.ratios
            for joint, share in drive.efforts:
                shares[k, joint] = share
        every = [part for _, column in drives for part in column]
        primitives = [primitive for _, primitive in every]
        return cls(
            ratios,
            shares,
            np.full(len(drives), rise_time),
            np.array([drive.joints[0] for drive, _ in drives], dtype=np.int64),
            np.cumsum([len(column) for _, column in drives], dtype=np.int64),
            np.array([each.shape for each in primitives], dtype=np.int64),
            np.array([each.side for each in primitives], dtype=np.int64),
            np.array([each.position for each in primitives], dtype=np.int64),
            np.array([each.width for each in primitives], dtype=np.float64),
            np.array([each.harmonic for each in primitives], dtype=np.float64),
            np.array([each.acceleration for each in primitives], dtype=np.float64),
            np.array([each.centre for each in primitives], dtype=np.float64),
            np.array([factor for factor, _ in every], dtype=np.float64),
            np.array([each.loaded for each in primitives], dtype=np.bool_),
        )


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
    features: CompiledFriction, q: Array, dq: Array, ddq: Array, load: Array, out: Array
) -> None:
    """Set the features (n, K) of friction at one state, by `FrictionBasis.compiled`."""
    first = 0
    for k in range(len(features.ends)):
        bearing = load[features.bearing[k]]
        feature = _torque_of_drive(features, k, first, q, dq, ddq, bearing, 0.0)
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
    discrepancy: Array,
    out: Array,
) -> None:
    """
    Differentiate the friction torques of one state by the loads: of joint i by load j, (n, n).

    Features are those of `FrictionBasis.compiled`; `loaded` numbers those that depend on a load,
    affine in a load of one sign, so that a unit of load shows the slope. The discrepancy of their
    signs (see `drive_friction`) has shape (K,).
    """
    out[:] = 0.0
    for k in loaded:
        bearing = features.bearing[k]
        sign = -1.0 if load[bearing] < 0.0 else 1.0
        first = features.ends[k - 1] if k > 0 else 0
        change = _torque_of_drive(features, k, first, q, dq, ddq, sign, discrepancy[k])
        change -= _torque_of_drive(features, k, first, q, dq, ddq, 0.0, discrepancy[k])
        for j in range(len(q)):
            out[j, bearing] += features.shares[k, j] * coefficients[k] * sign * change


@jit_reading
def load_slopes(
    features: CompiledFriction,
    loaded: IndexArray,
    coefficients: Array,
    q: Array,
    dq: Array,
    ddq: Array,
    load: Array,
    discrepancy: Array,
) -> Array:
    """Return the slopes of `set_load_slopes` at N states (N, n), shape (N, n, n)."""
    out = np.empty((*load.shape, load.shape[1]))
    for t in range(len(q)):
        state = q[t], dq[t], ddq[t], load[t]
        set_load_slopes(features, loaded, coefficients, *state, discrepancy[t], out[t])
    return out


@jit_reading
def values_of_drives(
    friction: CompiledFriction, q: Array, dq: Array, ddq: Array, load: Array, discrepancy: Array
) -> Array:
    """
    Return the friction of m drives at N states (N, n), shape (N, m).

    The discrepancy of their signs (see `drive_friction`) has shape (N, m).
    """
    out = np.empty(discrepancy.shape)
    for t in range(len(q)):
        first = 0
        for m in range(len(friction.ends)):
            bearing = load[t, friction.bearing[m]]
            out[t, m] = _torque_of_drive(
                friction, m, first, q[t], dq[t], ddq[t], bearing, discrepancy[t, m]
            )
            first = friction.ends[m]
    return out


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
    """
    Return the friction torque of one drive.

    The smooth sign of width w is that of the velocity as a low-pass leaves it: tanh(dq / u), where
    u^2 = w^2 + smoothing^2, and the smoothing is the change of dq while the low-pass responds. A
    joint that reverses with acceleration ddq has the velocity ddq t, and tanh(t / rise_time) is
    nearly the low-pass of a step. The discrepancy of the low-passed sign to tanh(dq / smoothing)
    counts as far as the low-pass makes the width, smoothing^2 / u^2.
    """
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
