"""Friction that remembers, along a stream of states."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.paths import dahl_states, LONGEST_GAP_S
from lip_id_ros.joint_history import JointHistory


class RunningMemory:
    """
    What friction with a memory adds to the torques of single states, one state after another.

    Nothing is known at the first state, and after `LONGEST_GAP_S` without any.

    """

    def __init__(self, friction: FrictionModel) -> None:
        self._friction = friction
        self._q, self._dahl, self._now = np.zeros(0), np.zeros(0), -np.inf
        dahl_states(np.zeros((1, 1)), np.ones(1, dtype=np.bool_))  # compiled before it is needed

    def torque(self, state: Array, now: float) -> Array:
        """Return the torque to add, (n,) [N m or N], at a state of shape (3, n) and a time [s]."""
        q = state[0]
        if 0.0 <= now - self._now <= LONGEST_GAP_S:
            path = np.array([self._q, q])
            self._dahl = dahl_states(path, np.array([True, False]), self._dahl)[1]
        else:
            self._dahl = dahl_states(q[None], np.ones(1, dtype=np.bool_))[0]
        self._q, self._now = q.copy(), now
        at, rate, change = state[:, None]
        load, history = np.zeros_like(at), JointHistory(dahl=self._dahl[None])
        return np.asarray(self._friction.torque(at, rate, change, load, history)[0])
