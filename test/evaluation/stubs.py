"""An estimator that knows the truth, but for errors that a test can compute by hand."""

from __future__ import annotations

import numpy as np
from simulation.pendulums import INERTIA, Pendulums, WEIGHT

from lip_id_ros.arrays import Array
from lip_id_ros.model import Prediction, StandardDeviation


class Knowing:
    """
    The pendulums' own formulas.

    `torque_error` is added to the torques, `energy_error` to the kinetic energy, `offset` to the
    potential energy (None: it has none), `inertia` takes the place of the true one.

    """

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
        self.calls: list[int] = []

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
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
        )

    def inertia_matrix(self, q: Array) -> Array:
        return np.tile(np.diag(self.inertia), (len(q), 1, 1))

    def standard_deviation(self, q: Array, dq: Array, ddq: Array) -> StandardDeviation:
        self.calls.append(len(q))
        energy = 0.1 * np.ones(len(q))
        return StandardDeviation(
            tau=0.3 * np.ones_like(q),
            kinetic=energy,
            potential=None if self.offset is None else energy,
        )
