"""What a real joint has besides rigid bodies, and what sensors make of its motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.dataset import Dataset
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.simulation.arm import Dynamics
from lip_id_ros.simulation.datasets import Trajectory, with_truth

Floats = NDArray[np.float64]

REST = 1e-3  # [rad/s]; slower than that, Coulomb friction fades


@dataclass(frozen=True)
class JointEffects:
    """
    Torques of friction, rotors and gears; every field has shape (n,).

    Attributes
    ----------
    viscous : ndarray
        [N m s/rad].
    coulomb, stiction : ndarray
        Friction of a fast joint, and what is added to it near rest [N m].
    stribeck_speed : ndarray
        Speed at which the added part has fallen by 1/e [rad/s].
    rotor : ndarray
        Inertia of the rotor, seen through the gear [kg m^2].
    ripple : ndarray
        Amplitude of the torque that repeats `PERIODS` times in a turn [N m].

    """

    viscous: Floats
    coulomb: Floats
    stiction: Floats
    stribeck_speed: Floats
    rotor: Floats
    ripple: Floats

    def first(self, n_joints: int) -> JointEffects:
        """Keep the effects of the first joints."""
        return JointEffects(*(values[:n_joints] for values in vars(self).values()))

    def torque(self, q: Floats, dq: Floats, ddq: Floats) -> Floats:
        """Return the torque [N m], shape (N, n)."""
        near_rest = self.stiction * np.exp(-np.square(dq / self.stribeck_speed))
        dry = (self.coulomb + near_rest) * np.tanh(dq / REST)
        return self.viscous * dq + dry + self.rotor * ddq + self.ripple * np.sin(PERIODS * q)


PERIODS = 12.0
PANDA_EFFECTS = JointEffects(
    viscous=np.array([1.0, 1.0, 0.8, 0.8, 0.4, 0.3, 0.3]),
    coulomb=np.array([1.0, 1.0, 0.8, 0.8, 0.5, 0.4, 0.4]),
    stiction=np.array([0.4, 0.4, 0.3, 0.3, 0.2, 0.15, 0.15]),
    stribeck_speed=np.full(7, 0.05),
    rotor=np.array([0.6, 0.6, 0.5, 0.4, 0.2, 0.2, 0.1]),
    ripple=np.array([0.3, 0.3, 0.2, 0.2, 0.1, 0.05, 0.05]),
)
"""Plausible sizes, a few percent of each joint's torque; not measured on any robot."""


class ArmWithEffects:
    """
    An arm and what is in its joints.

    Parameters
    ----------
    arm : Dynamics
    effects : JointEffects

    """

    def __init__(self, arm: Dynamics, effects: JointEffects) -> None:
        self._arm, self._effects = arm, effects
        self.joint_names, self.joint_types = arm.joint_names, arm.joint_types

    def inverse_dynamics(self, q: Floats, dq: Floats, ddq: Floats) -> Floats:
        """Torques [N m], shape (N, n)."""
        return self._arm.inverse_dynamics(q, dq, ddq) + self._effects.torque(q, dq, ddq)

    def kinetic(self, q: Floats, dq: Floats) -> Floats:
        """Kinetic energy [J], shape (N,), with that of the rotors."""
        rotors = 0.5 * np.square(dq) @ self._effects.rotor
        return np.asarray(self._arm.kinetic(q, dq) + rotors)

    def potential(self, q: Floats) -> Floats:
        """Potential energy [J], shape (N,)."""
        return self._arm.potential(q)


@dataclass(frozen=True)
class Sensors:
    """
    White noise and steps of what is read.

    Attributes
    ----------
    position_step, position_noise : float
        [rad].
    velocity_noise : float
        [rad/s].
    torque_step, torque_noise : float
        [N m].

    """

    position_step: float = 2 * np.pi / 2**17
    position_noise: float = 2e-5
    velocity_noise: float = 2e-3
    torque_step: float = 0.01
    torque_noise: float = 0.1


def measured(
    arm: Dynamics,
    trajectory: Trajectory,
    seconds: float,
    rate_hz: float,
    rng: np.random.Generator,
    sensors: Sensors | None = None,
) -> Dataset:
    """
    Record a motion as a driver would, and prepare it as any recording is prepared.

    Returns
    -------
    Dataset
        Filtered, differentiated and decimated by default settings, with the truth beside it.

    """
    sensors = sensors or Sensors()
    t = np.arange(round(seconds * rate_hz), dtype=np.float64) / rate_hz
    q, dq, ddq = trajectory.sample(t)
    tau = arm.inverse_dynamics(q, dq, ddq)

    def noisy(values: Floats, std: float) -> Floats:
        return values + std * rng.standard_normal(values.shape)

    samples = JointSamples(
        t=t,
        position=_stepped(noisy(q, sensors.position_noise), sensors.position_step),
        velocity=noisy(dq, sensors.velocity_noise),
        effort=_stepped(noisy(tau, sensors.torque_noise), sensors.torque_step),
        joint_names=arm.joint_names,
    )
    found = with_truth(preprocess(samples), arm, trajectory)
    return replace(found, provenance={'sources': ['simulation']})


def _stepped(values: Floats, step: float) -> Floats:
    return np.asarray(step * np.round(values / step))
