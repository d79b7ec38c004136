"""Friction that remembers, along a stream of states."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.friction.dahl import advance_dahl, LONGEST_GAP_S
from lip_id_ros.friction.dahl_friction import add_dahl_torque, DahlFriction
from lip_id_ros.joint_types import DISPLACEMENTS
from lip_id_ros.numba_jit import jit


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
