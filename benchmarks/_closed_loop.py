"""Computed torque (paper, eq. `CT_control`) on a simulated arm: feedforward plus PD."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.control.settings import Gains
from lip_id_ros.model import DynamicsModel
from lip_id_ros.progress import Progress, silent
from lip_id_ros.simulation import (
    Drives,
    JointFriction,
    Measurement,
    SimulatedArm,
    TorqueControlledArm,
)
from lip_id_ros.simulation.arm import Dynamics
from lip_id_ros.simulation.trajectories import Trajectory


class Feedforward(Protocol):
    """Inverse dynamics of one state; q, dq and ddq have shape (n,)."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""


class LearnedFeedforward:
    """Torques of a learned model."""

    def __init__(self, model: DynamicsModel) -> None:
        self._model = model

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""
        return self._model.query(q, dq, ddq).tau


@dataclass(frozen=True)
class Torques:
    """The two parts of a command, each of shape (n,) [N m or N]."""

    feedforward: Array
    feedback: Array

    @property
    def command(self) -> Array:
        """Their sum."""
        return self.feedforward + self.feedback


class ComputedTorque:
    """Torques that follow a reference."""

    def __init__(self, feedforward: Feedforward, gains: Gains) -> None:
        self._feedforward = feedforward
        self._gains = gains

    def torques(self, reference: tuple[Array, Array, Array], q: Array, dq: Array) -> Torques:
        """
        Compute the command of one control period.

        Parameters
        ----------
        reference : tuple of ndarray, each of shape (n,)
            Positions, velocities and accelerations to follow.
        q, dq : ndarray, shape (n,)
            Measured.

        """
        feedback = self._gains.feedback(reference[0] - q, reference[1] - dq)
        return Torques(self._feedforward.torque(*reference), feedback)


class FrictionalArm:
    """An arm and the friction in its joints; its energies stay what they are."""

    def __init__(self, arm: Dynamics, friction: JointFriction) -> None:
        self.arm = arm
        self.friction = friction
        self.joint_names = arm.joint_names
        self.joint_types = arm.joint_types

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (N, n), with friction."""
        return self.arm.inverse_dynamics(q, dq, ddq) + self.friction.torque(dq)

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Kinetic energy [J], shape (N,)."""
        return self.arm.kinetic(q, dq)

    def potential(self, q: Array) -> Array:
        """Potential energy [J], shape (N,)."""
        return self.arm.potential(q)


class NominalFeedforward:
    """Torques of a rigid-body model."""

    def __init__(self, arm: Dynamics) -> None:
        self._arm = arm

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""
        tau: Array = self._arm.inverse_dynamics(q[None], dq[None], ddq[None])[0]
        return tau


REPORT_EVERY = 200


@dataclass(frozen=True)
class Tracking:
    """
    Record of a run, N steps of n joints.

    Attributes
    ----------
    t : ndarray, shape (N,)
        [s].
    q, dq, tau : ndarray, shape (N, n)
        Measured.
    reference : tuple of ndarray, each of shape (N, n)
        Positions, velocities, accelerations that were to be followed.
    feedforward, feedback : ndarray, shape (N, n)
        Parts of the commands [N m or N].
    kinetic, potential : ndarray, shape (N,)
        True energies of the exact motion [J].

    """

    t: Array
    q: Array
    dq: Array
    tau: Array
    reference: tuple[Array, Array, Array]
    feedforward: Array
    feedback: Array
    kinetic: Array
    potential: Array

    @property
    def error(self) -> Array:
        """Reference minus measured positions [rad or m], shape (N, n)."""
        return self.reference[0] - self.q


def no_contact(t: float) -> float:
    """Nothing touches the arm."""
    return 0.0


def placed(
    arm: SimulatedArm, drives: Drives, reference: Trajectory, rng: np.random.Generator
) -> TorqueControlledArm:
    """Put an arm at the beginning of a reference, with the torque that it needs there."""
    q, dq, ddq = reference.sample(np.zeros(1))
    simulated = TorqueControlledArm(arm, drives, q[0], dq[0], rng)
    needed = simulated.bodies.inverse_dynamics(q, dq, ddq)[0] + drives.friction.torque(dq[0])
    simulated.hold(needed)
    return simulated


def track(
    simulated: TorqueControlledArm,
    controller: ComputedTorque,
    reference: Trajectory,
    duration: float,
    contact: Callable[[float], Array | float] = no_contact,
    progress: Progress = silent,
) -> Tracking:
    """
    Let a controller follow a reference for a duration [s], from the arm's present state.

    `contact` gives external torques (n,) at a time [s].

    """
    n_steps = round(duration / simulated.drives.step)
    times = simulated.t + simulated.drives.step * np.arange(n_steps, dtype=np.float64)
    references = reference.sample(times)
    measured: list[Measurement] = []
    states, torques = [], []
    for k in range(n_steps):
        measured.append(simulated.measure())
        states.append((simulated.q, simulated.dq))
        wanted = (references[0][k], references[1][k], references[2][k])
        torques.append(controller.torques(wanted, measured[-1].q, measured[-1].dq))
        simulated.step(torques[-1].command, contact(simulated.t))
        if k % REPORT_EVERY == 0:
            progress('control', k, n_steps)
    q, dq = (np.array(values) for values in zip(*states, strict=True))
    return Tracking(
        t=np.array([each.t for each in measured]),
        q=np.array([each.q for each in measured]),
        dq=np.array([each.dq for each in measured]),
        tau=np.array([each.tau for each in measured]),
        reference=references,
        feedforward=np.array([each.feedforward for each in torques]),
        feedback=np.array([each.feedback for each in torques]),
        kinetic=simulated.bodies.kinetic(q, dq),
        potential=simulated.bodies.potential(q),
    )
