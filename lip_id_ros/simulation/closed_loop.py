"""A simulated arm under torque control, with friction and sensors, and its control loop."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.control import ComputedTorque
from lip_id_ros.progress import Progress, silent
from lip_id_ros.simulation.arm import Dynamics, SimulatedArm
from lip_id_ros.simulation.trajectories import Trajectory


@dataclass(frozen=True)
class JointFriction:
    """
    Viscous [N m s/rad or N s/m] and Coulomb friction [N m or N], none at rest; shapes (n,).

    Over velocities of `sign_width` [rad/s or m/s] the sign changes, as equations of motion need
    it; 0 for a jump.

    """

    viscous: Array
    coulomb: Array
    sign_width: float = 0.0

    def torque(self, dq: Array) -> Array:
        """Torque [N m or N], shape (N, n) or (n,), that a motion of velocity `dq` needs."""
        sign = np.tanh(dq / self.sign_width) if self.sign_width > 0.0 else np.sign(dq)
        return np.asarray(self.viscous * dq + self.coulomb * sign)


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


@dataclass(frozen=True)
class Drives:
    """
    Rotors, friction and sensors of the joints.

    Attributes
    ----------
    rotor_inertia : ndarray, shape (n,)
        Seen at the joint [kg m^2 or kg].
    ripple : float
        Standard deviation of the white noise on the torque that acts [N m or N].
    position_noise, velocity_noise, torque_noise : float
        Standard deviations of the sensors [rad or m, rad/s or m/s, N m or N].
    delay : int
        Steps between a command and its torque.
    step : float
        Between two commands [s].

    """

    rotor_inertia: Array
    friction: JointFriction
    ripple: float = 0.0
    position_noise: float = 0.0
    velocity_noise: float = 0.0
    torque_noise: float = 0.0
    delay: int = 0
    step: float = 1e-3


@dataclass(frozen=True)
class Measurement:
    """Measurements (n,) at a time [s]; the torques are those of the step that has just ended."""

    t: float
    q: Array
    dq: Array
    tau: Array


class TorqueControlledArm:
    """
    Rigid bodies driven by torques; one step is one fourth-order Runge-Kutta step.

    Attributes
    ----------
    bodies : SimulatedArm
        The rigid bodies with their rotors: the truth for energies and torques.
    t, q, dq
        The exact state: time [s], positions, velocities.

    """

    def __init__(
        self, arm: SimulatedArm, drives: Drives, q: Array, dq: Array, rng: np.random.Generator
    ) -> None:
        self.bodies = arm.with_rotor_inertia(drives.rotor_inertia)
        self.drives = drives
        self.t = 0.0
        self.q = np.array(q, dtype=np.float64)
        self.dq = np.array(dq, dtype=np.float64)
        self._n_steps = 0
        self._rng = rng
        self._acting = np.zeros_like(self.q)
        self._underway = deque([np.zeros_like(self.q)] * drives.delay)

    def hold(self, tau: Array) -> None:
        """Fill the commands under way, as if `tau` had been commanded for long."""
        self._acting = np.array(tau, dtype=np.float64)
        self._underway = deque([self._acting] * self.drives.delay)

    def stop(self, q: Array) -> None:
        """Stand at positions (n,) without torques."""
        self.q, self.dq = np.array(q, dtype=np.float64), np.zeros_like(self.q)
        self.hold(np.zeros_like(self.q))

    def measure(self) -> Measurement:
        """Read the sensors."""
        drives = self.drives
        return Measurement(
            self.t,
            self._noisy(self.q, drives.position_noise),
            self._noisy(self.dq, drives.velocity_noise),
            self._noisy(self._acting, drives.torque_noise),
        )

    def step(self, command: Array, external: Array | float = 0.0) -> None:
        """
        Advance by one step.

        Parameters
        ----------
        command : ndarray, shape (n,)
            Torques [N m or N], which act `delay` steps later and are held for a step.
        external : ndarray, shape (n,), or float
            Torques of a contact, which act at once and are not measured.

        """
        self._underway.append(np.array(command, dtype=np.float64))
        self._acting = self._noisy(self._underway.popleft(), self.drives.ripple)
        self.q, self.dq = self._moved(self._acting + external)
        self._n_steps += 1
        self.t = self._n_steps * self.drives.step

    def _moved(self, tau: Array) -> tuple[Array, Array]:
        h, q, dq = self.drives.step, self.q, self.dq
        a1 = self._acceleration(q, dq, tau)
        v2 = dq + 0.5 * h * a1
        a2 = self._acceleration(q + 0.5 * h * dq, v2, tau)
        v3 = dq + 0.5 * h * a2
        a3 = self._acceleration(q + 0.5 * h * v2, v3, tau)
        v4 = dq + h * a3
        a4 = self._acceleration(q + h * v3, v4, tau)
        return q + h / 6 * (dq + 2 * v2 + 2 * v3 + v4), dq + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    def _acceleration(self, q: Array, dq: Array, tau: Array) -> Array:
        return self.bodies.forward_dynamics(q, dq, tau - self.drives.friction.torque(dq))

    def _noisy(self, values: Array, std: float) -> Array:
        return values + std * self._rng.standard_normal(values.shape)


class NominalFeedforward:
    """Torques of a rigid-body model, for `lip_id_ros.control.ComputedTorque`."""

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
