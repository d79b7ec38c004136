"""Dahl's friction of an arm, compiled: what joints remember, and what is not known of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.friction.dahl import Dahl
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.joint_types import DISPLACEMENTS
from lip_id_ros.numba_jit import jit, jit_inlined


class DahlFriction(NamedTuple):
    """Dahl's friction of joints, a row for each term; drives of several joints have none."""

    joint: IntArray
    ratio: Array
    displacement: IntArray  # its place in `DISPLACEMENTS`
    place: IntArray  # of its coefficient among those of all friction
    width: Array
    coefficient: Array
    rise_time: float

    @classmethod
    def of(cls, friction: FrictionModel, left_out: BoolArray) -> DahlFriction:
        """Return the terms of friction that remember, but for joints (n,) that are left out."""
        basis = friction.basis
        rows = [
            (
                part.drive.joints[0],
                DISPLACEMENTS.index(part.term.displacement),
                place.start,
                part.drive.ratios[0],
                part.term.width,
                friction.coefficients[place.start],
            )
            for part, place in zip(basis.terms, basis.slices, strict=True)
            if isinstance(part.term, Dahl) and len(part.drive.joints) == 1
            if not left_out[part.drive.joints[0]]
        ]
        columns = np.array(rows).reshape(-1, 6).T.copy()
        joint, displacement, place, ratio, width, coefficient = columns
        return cls(
            joint.astype(np.int64),
            ratio,
            displacement.astype(np.int64),
            place.astype(np.int64),
            width,
            coefficient,
            float(basis.rise_time),
        )

    def largest(self, n_joints: int) -> Array:
        """Return the largest torque of each joint that its history decides, (n,) [N m or N]."""
        sizes = np.abs(self.ratio) * self.coefficient
        return np.bincount(self.joint, weights=sizes, minlength=n_joints)

    def torque(self, dq: Array, ddq: Array, states: Array) -> Array:
        """Return the torques (N, n) [N m or N] of `dahl_states` at velocities (N, n)."""
        return np.asarray(_torque(self, dq, ddq, states))

    def single_std(self, dq: Array, ddq: Array) -> Array:
        """
        Return deviations (N, n) of torques of single states, whose past is unknown [N m or N].

        A joint that moves has friction of its sign; one that rests has any.
        """
        return np.asarray(_single_std(self, dq, ddq))

    def unknown_std(self, share: Array) -> Array:
        """
        Return deviations (N, n) of torques along a path with an unknown start [N m or N].

        Of the start so much is left as `unknown_share` says, shape (N, n, D), at any velocity: a
        joint that begins to move is not at once at the friction of its sign.
        """
        out = np.zeros(share.shape[:2])
        for joint, kept, size in zip(self.joint, self.displacement, self.coefficient, strict=True):
            out[:, joint] += np.square(size * share[:, joint, kept])
        return np.sqrt(out)


@jit
def add_dahl_torque(terms: DahlFriction, dq: Array, ddq: Array, states: Array, out: Array) -> None:
    """Add the torques (n,) of friction with the states (n, D) of `Dahl` at one joint state."""
    for k in range(len(terms.joint)):
        j = terms.joint[k]
        remembered = states[j, terms.displacement[k]] - _sign(terms, k, dq[j], ddq[j])
        out[j] += terms.ratio[k] * terms.coefficient[k] * remembered


@jit
def _torque(terms: DahlFriction, dq: Array, ddq: Array, states: Array) -> Array:
    out = np.zeros(dq.shape)
    for t in range(len(dq)):
        add_dahl_torque(terms, dq[t], ddq[t], states[t], out[t])
    return out


@jit
def _single_std(terms: DahlFriction, dq: Array, ddq: Array) -> Array:
    out = np.zeros(dq.shape)
    for t in range(len(dq)):
        for k in range(len(terms.joint)):
            j = terms.joint[k]
            sign = _sign(terms, k, dq[t, j], ddq[t, j])
            out[t, j] += terms.coefficient[k] ** 2 * (1.0 - sign**2)
    return np.sqrt(out)


@jit_inlined
def _sign(terms: DahlFriction, k: int, dq: float, ddq: float) -> float:
    smoothing = terms.rise_time * terms.ratio[k] * ddq
    return math.tanh(terms.ratio[k] * dq / math.hypot(terms.width[k], smoothing))
