"""A model that has the truth, but for errors that a test can compute by hand."""

from __future__ import annotations

import numpy as np
from simulation.pendulums import INERTIA, Pendulums, swing, WEIGHT

from lip_id_ros.arrays import Array, EVERY, Rows
from lip_id_ros.model import Prediction, Query, StandardDeviation


class Knowing:
    """
    The pendulums' own formulas, a `lip_id_ros.model.DynamicsModel`.

    `torque_error` is added to the torques, `energy_error` to the kinetic energy, `offset` to the
    potential energy (None: it has none), `inertia` takes the place of the true one.

    """

    joint_names, joint_types = swing(0).joint_names, swing(0).joint_types
    n_joints = size = 3
    training_range = (-np.ones((3, 3)), np.array([[1.0] * 3, [2.0] * 3, [3.0] * 3]))

    def __init__(
        self,
        torque_error: float = 0.0,
        energy_error: float = 0.0,
        offset: float | None = 0.0,
        inertia: Array = INERTIA,
    ) -> None:
        self.torque_error = torque_error
        self.energy_error = energy_error
        self.offset = offset
        self.inertia = inertia
        self.has_potential = offset is not None
        self.noise_std = np.full(3, 0.4)
        self.calls: list[int] = []

    def predict(
        self, q: Array, dq: Array, ddq: Array, t: Array | None = None, *, return_std: bool = False
    ) -> Prediction:
        self.calls.append(len(q))
        arm = Pendulums()
        inertial, gravity = INERTIA * ddq, WEIGHT * np.sin(q)
        friction = np.full_like(q, self.torque_error)
        return Prediction(
            tau=inertial + gravity + friction,
            inertial=inertial,
            coriolis=np.zeros_like(q),
            gravity=gravity,
            friction=friction,
            kinetic=arm.kinetic(q, dq) + self.energy_error,
            potential=None if self.offset is None else arm.potential(q) + self.offset,
            std=self.standard_deviation(q, dq, ddq) if return_std else None,
        )

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        found = self.predict(q[None], dq[None], ddq[None])
        potential = np.nan if found.potential is None else float(found.potential[0])
        return Query(found.tau[0], float(found.kinetic[0]), potential, found.gravity[0])

    def efforts(self, torque: Array) -> Array:
        return torque

    def inertia_matrix(self, q: Array) -> Array:
        return np.tile(np.diag(self.inertia), (len(q), 1, 1))

    def standard_deviation(
        self, q: Array, dq: Array, ddq: Array, t: Array | None = None, rows: Rows = EVERY
    ) -> StandardDeviation:
        q = q[rows]
        energy = 0.1 * np.ones(len(q))
        return StandardDeviation(
            tau=0.3 * np.ones_like(q),
            measurement=0.5 * np.ones_like(q),
            kinetic=energy,
            potential=None if self.offset is None else energy,
        )
