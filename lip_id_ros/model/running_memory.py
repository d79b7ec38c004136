"""Friction that remembers, along a stream of states."""

from __future__ import annotations

from copy import copy

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.friction.dahl import dahl_states, LONGEST_GAP_S, Steps
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.joint_history import DISPLACEMENTS, JointHistory


class RunningMemory:
    """
    What friction with a memory adds to the torques of single states, one state after another.

    Nothing is known but the velocity at the first state, and after `LONGEST_GAP_S` without any.
    """

    def __init__(self, friction: FrictionModel, revolute: BoolArray) -> None:
        self._friction, self._revolute = friction, revolute
        self._q, self._now = np.zeros(revolute.size), -np.inf
        self._dahl = np.zeros((revolute.size, len(DISPLACEMENTS)))
        self._dahl = self._after(self._q, self._q, True)  # compiled before it is needed

    def with_friction(self, friction: FrictionModel) -> RunningMemory:
        """Return one with other coefficients that remembers the same states."""
        other = copy(self)
        other._friction = friction
        return other

    def torque(self, state: Array, now: float) -> Array:
        """Return the torque to add, (n,) [N m or N], at a state of shape (3, n) and a time [s]."""
        q, dq = state[:2]
        self._dahl = self._after(q, dq, not 0.0 <= now - self._now <= LONGEST_GAP_S)
        self._q, self._now = q.copy(), now
        at, rate, change = state[:, None]
        load, history = np.zeros_like(at), JointHistory(dahl=self._dahl[None])
        return np.asarray(self._friction.torque(at, rate, change, load, history)[0])

    def _after(self, q: Array, dq: Array, begins: bool) -> Array:
        """Return the states of Dahl's friction at the next positions, shape (n, D)."""
        path, anew = np.array([self._q, q]), np.array([begins, begins])
        steps = Steps.of(path, np.array([dq, dq]), anew, self._revolute)
        last = Steps(steps.size[1:], steps.begins[1:])
        return np.asarray(dahl_states(last, self._dahl)[0])
