"""Dahl's friction of an arm, compiled: what joints remember, and what is not known of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.friction.dahl import advance_dahl, LONGEST_GAP_S
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
        signs, place, joint, displacement = friction.basis.memory
        ratio = signs.compiled.ratios[np.arange(joint.size), joint]
        kept = ~left_out[joint]
        return cls(
            joint[kept],
            ratio[kept],
            displacement[kept],
            place[kept],
            signs.compiled.width[kept],
            friction.coefficients[place[kept]],
            float(friction.basis.rise_time),
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
    """Add the torques (n,) of friction with the states (n, D) of `dahl` at one joint state."""
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


class RunningMemory:
    """
    What friction with a memory adds to the torques of single states, one state after another.

    Nothing is known but the velocity at the first state, and after `LONGEST_GAP_S` without any.
    """

    def __init__(self, friction: DahlFriction, revolute: BoolArray) -> None:
        self._revolute = revolute
        self._friction = friction._replace(coefficient=friction.coefficient.copy())
        self._q, self._now = np.zeros(revolute.size), -np.inf
        self._dahl = np.zeros((revolute.size, len(DISPLACEMENTS)))
        self.torque(np.zeros((3, revolute.size)), -np.inf)  # compiled before it is needed

    def use(self, coefficients: Array) -> None:
        """Go on with other coefficients (K,) of all friction of the arm."""
        self._friction.coefficient[:] = coefficients[self._friction.place]

    def torque(self, state: Array, now: float) -> Array:
        """Return the torque to add, (n,) [N m or N], at a state of shape (3, n) and a time [s]."""
        begins = not 0.0 <= now - self._now <= LONGEST_GAP_S
        self._now, out = now, np.zeros(self._revolute.size)
        _add_torque(
            np.ascontiguousarray(state, dtype=np.float64),
            begins,
            self._revolute,
            self._friction,
            self._q,
            self._dahl,
            out,
        )
        return out


@jit
def _add_torque(
    state: Array,
    begins: bool,
    revolute: BoolArray,
    friction: DahlFriction,
    q: Array,
    dahl: Array,
    out: Array,
) -> None:
    """Add the torques, and advance the positions (n,) and Dahl's states (n, D) to this state."""
    for j in range(len(q)):
        advance_dahl(state[0, j] - q[j], state[1, j], begins, revolute[j], dahl[j])
        q[j] = state[0, j]
    add_dahl_torque(friction, state[1], state[2], dahl, out)
