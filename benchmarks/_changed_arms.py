"""Copies of simulated arms that are not quite the right ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.simulation import SimulatedArm


def with_wrong_masses(
    arm: SimulatedArm, mass_share: float, centre_shift: float, rng: np.random.Generator
) -> SimulatedArm:
    """
    Copy an arm with other bodies: what a poor data sheet would give.

    Each mass, and its inertia with it, changes by a share drawn uniformly from [-mass_share,
    mass_share], each coordinate of a centre of mass by a distance from [-centre_shift,
    centre_shift] [m].
    """
    import pinocchio

    def spoil(model: Any) -> None:
        for joint in range(1, model.njoints):
            body = model.inertias[joint]
            factor = 1.0 + rng.uniform(-mass_share, mass_share)
            centre = body.lever + rng.uniform(-centre_shift, centre_shift, 3)
            model.inertias[joint] = pinocchio.Inertia(
                factor * body.mass, centre, factor * body.inertia
            )

    return arm.changed(spoil)


def with_payload(arm: SimulatedArm, mass: float, at: Array) -> SimulatedArm:
    """Copy an arm with a point mass [kg] on the last body, at a place in its frame (3,) [m]."""
    import pinocchio

    def load(model: Any) -> None:
        body = pinocchio.Inertia(mass, np.asarray(at, np.float64), np.zeros((3, 3)))
        model.inertias[model.njoints - 1] += body

    return arm.changed(load)


def with_gravity(arm: SimulatedArm, gravity: Array) -> SimulatedArm:
    """Copy an arm in another field of gravity (3,) [m/s^2], as on a base that is tilted."""

    def turn(model: Any) -> None:
        model.gravity.linear = np.array(gravity, dtype=np.float64)

    return arm.changed(turn)
