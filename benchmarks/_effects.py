"""What a real joint has between its motor and its link."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.simulation.arm import Dynamics
from lip_id_ros.simulation.trajectories import JointMotion

REST = 1e-3  # [rad/s]; slower than that, friction fades
N_JOINTS = 7


@dataclass(frozen=True)
class Drives:
    """
    Friction, rotors, gears and motor currents of all joints; every field has shape (n,).

    `viscous` [N m s/rad]. `coulomb`: friction of a fast joint without load, `stiction`: what is
    added to it near rest [N m], which has fallen by 1/e at `stribeck_speed` [rad/s];
    `load_coulomb`, `load_stiction`: the same for each N m that the gear carries. `uneven`: share
    by which friction varies within a turn. `rotor`: inertia, seen through the gear [kg m^2].
    `ripple`: torque that repeats `ripple_periods` times a turn [N m]. `stiffness`: of the gear
    [N m/rad]. `gain`: recorded over true torque.

    """

    viscous: Array
    coulomb: Array
    stiction: Array
    load_coulomb: Array
    load_stiction: Array
    stribeck_speed: Array
    uneven: Array
    rotor: Array
    ripple: Array
    ripple_periods: Array
    stiffness: Array
    gain: Array

    def first(self, n_joints: int) -> Drives:
        """Keep the drives of the first joints."""
        return Drives(*(getattr(self, field.name)[:n_joints] for field in fields(self)))

    def friction(self, q: Array, dq: Array, load: Array) -> Array:
        """Return the torque of friction [N m] under the load of the links [N m], all (N, n)."""
        carried = np.abs(load)
        near_rest = np.exp(-np.square(dq / self.stribeck_speed))
        dry = self.coulomb + self.load_coulomb * carried
        dry = dry + (self.stiction + self.load_stiction * carried) * near_rest
        place = 1.0 + self.uneven * np.sin(q + np.arange(q.shape[1]))
        return place * (self.viscous * dq + dry * np.tanh(dq / REST))

    def torque(self, motor: JointMotion, load: Array) -> Array:
        """Return the torque of the motors as recorded [N m], shape (N, n)."""
        q, dq, ddq = motor
        own = self.rotor * ddq + self.ripple * np.sin(self.ripple_periods * q)
        return self.gain * (load + own + self.friction(q, dq, load))


def _same(value: float) -> Array:
    return np.full(N_JOINTS, value)


MILD = Drives(
    viscous=np.array([1.0, 1.0, 0.8, 0.8, 0.4, 0.3, 0.3]),
    coulomb=np.array([1.0, 1.0, 0.8, 0.8, 0.5, 0.4, 0.4]),
    stiction=np.array([0.4, 0.4, 0.3, 0.3, 0.2, 0.15, 0.15]),
    load_coulomb=_same(0.0),
    load_stiction=_same(0.0),
    stribeck_speed=_same(0.05),
    uneven=_same(0.0),
    rotor=np.array([0.6, 0.6, 0.5, 0.4, 0.2, 0.2, 0.1]),
    ripple=np.array([0.3, 0.3, 0.2, 0.2, 0.1, 0.05, 0.05]),
    ripple_periods=_same(12.0),
    stiffness=_same(np.inf),
    gain=_same(1.0),
)
"""A few percent of each joint's torque, and little that rigid bodies and Coulomb do not have."""

LARGEST = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])  # the maker's torques [N m]

INDUSTRIAL = Drives(
    viscous=0.015 * LARGEST,
    coulomb=0.03 * LARGEST,
    stiction=0.015 * LARGEST,
    load_coulomb=_same(0.023),
    load_stiction=_same(0.126),
    stribeck_speed=_same(0.1),
    uneven=_same(0.1),
    rotor=MILD.rotor,
    ripple=0.01 * LARGEST,
    ripple_periods=_same(200.0),
    stiffness=np.array([1e4, 1e4, 1e4, 1e4, 5e3, 5e3, 5e3]),
    gain=np.array([1.03, 0.96, 1.02, 0.97, 1.05, 0.98, 0.95]),
)
"""A geared arm whose torques are motor currents; comparison.md has the sources."""


def driven(
    arm: Dynamics, drives: Drives, link: JointMotion, step_s: float
) -> tuple[JointMotion, Array]:
    """
    Follow a motion of the links (N, n) that is one period long, sampled every `step_s`.

    What encoders see, and torques of the motors as recorded, without noise [N m]. The gears bend
    by load / stiffness, which leaves out only what friction and ripple bend them.

    """
    load = arm.inverse_dynamics(*link)
    bend = load / drives.stiffness
    rate = _derivative(bend, step_s)
    q, dq, ddq = (
        x + y for x, y in zip(link, (bend, rate, _derivative(rate, step_s)), strict=True)
    )
    return (q, dq, ddq), drives.torque((q, dq, ddq), load)


def _derivative(values: Array, step_s: float) -> Array:
    """Differentiate one period exactly, up to rounding."""
    omega = 2j * np.pi * np.fft.rfftfreq(len(values), step_s)
    changes = np.fft.irfft(omega[:, None] * np.fft.rfft(values, axis=0), len(values), axis=0)
    return np.asarray(changes)
