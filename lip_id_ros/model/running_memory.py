"""Friction that remembers, along a stream of states."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.friction.dahl import advance_dahl, Dahl, LONGEST_GAP_S
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.joint_history import DISPLACEMENTS
from lip_id_ros.numba_jit import jit


class _Terms(NamedTuple):
    """Dahl's friction of single joints, a row for each term."""

    joint: IntArray
    displacement: IntArray  # its place in `DISPLACEMENTS`
    width: Array
    coefficient: Array

    @classmethod
    def of(cls, friction: FrictionModel) -> _Terms:
        basis = friction.basis
        rows = [
            (part.drive.joints[0], DISPLACEMENTS.index(part.term.displacement), part.term.width, c)
            for part, c in zip(basis.terms, friction.coefficients, strict=True)
            if isinstance(part.term, Dahl) and len(part.drive.joints) == 1
        ]
        joint, displacement, width, coefficient = np.array(rows).reshape(-1, 4).T
        return cls(
            joint.astype(np.int64),
            displacement.astype(np.int64),
            np.ascontiguousarray(width),
            np.ascontiguousarray(coefficient),
        )


class RunningMemory:
    """
    What friction with a memory adds to the torques of single states, one state after another.

    Nothing is known but the velocity at the first state, and after `LONGEST_GAP_S` without any.
    `friction` has the terms that remember, and no others.
    """

    def __init__(self, friction: FrictionModel, revolute: BoolArray) -> None:
        self._revolute, self._terms = revolute, _Terms.of(friction)
        self._rise_time = friction.basis.rise_time
        self._q, self._now = np.zeros(revolute.size), -np.inf
        self._dahl = np.zeros((revolute.size, len(DISPLACEMENTS)))
        self.torque(np.zeros((3, revolute.size)), -np.inf)  # compiled before it is needed

    def with_friction(self, friction: FrictionModel) -> RunningMemory:
        """Return one with other coefficients that remembers the same states."""
        other = RunningMemory(friction, self._revolute)
        other._q, other._now, other._dahl = self._q.copy(), self._now, self._dahl.copy()
        return other

    def torque(self, state: Array, now: float) -> Array:
        """Return the torque to add, (n,) [N m or N], at a state of shape (3, n) and a time [s]."""
        begins = not 0.0 <= now - self._now <= LONGEST_GAP_S
        self._now, out = now, np.zeros(self._revolute.size)
        _add_torque(
            np.ascontiguousarray(state, dtype=np.float64),
            begins,
            self._revolute,
            self._rise_time,
            self._terms,
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
    rise_time: float,
    terms: _Terms,
    q: Array,
    dahl: Array,
    out: Array,
) -> None:
    """Add the torques, and advance the positions (n,) and Dahl's states (n, D) to this state."""
    for j in range(len(q)):
        advance_dahl(state[0, j] - q[j], state[1, j], begins, revolute[j], dahl[j])
        q[j] = state[0, j]
    for k in range(len(terms.joint)):
        j = terms.joint[k]
        sign = np.tanh(state[1, j] / np.hypot(terms.width[k], rise_time * state[2, j]))
        out[j] += terms.coefficient[k] * (dahl[j, terms.displacement[k]] - sign)
