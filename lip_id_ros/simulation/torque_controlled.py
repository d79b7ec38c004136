"""Arms driven by torques, with rotors, friction and sensors; those of a Panda."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.control.settings import Gains
from lip_id_ros.simulation.arm import panda, SimulatedArm


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


@dataclass(frozen=True)
class Drives:
    """Rotors, friction and sensors of the joints; noise is given by standard deviations."""

    rotor_inertia: Array  # (n,), at the joint [kg m^2 or kg]
    friction: JointFriction
    ripple: float = 0.0  # of the torque that acts [N m or N]
    position_noise: float = 0.0  # [rad or m]
    velocity_noise: float = 0.0  # [rad/s or m/s]
    torque_noise: float = 0.0  # [N m or N]
    delay: int = 0  # steps between a command and its torque
    step: float = 1e-3  # between two commands [s]


@dataclass(frozen=True)
class Measurement:
    """Measurements (n,) at a time [s]; the torques are those of the step that has just ended."""

    t: float
    q: Array
    dq: Array
    tau: Array


class TorqueControlledArm:
    """
    Rigid bodies driven by torques.

    A step is one of fourth-order Runge-Kutta. `bodies` are with rotors: the truth of energies and
    torques at the exact `t`, `q`, `dq`.
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
        Advance by one step, for which a command (n,) [N m or N] is held, `delay` steps later.

        The torques of a contact act at once and are not measured.
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


# The maker's ready posture: far from the limits that zero is beyond (joint 4) or at (joint 6).
POSTURE = (0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4)
# With these the nominal model's errors and feedback come out as large as the paper's.
STIFFNESS = (600.0, 600.0, 400.0, 300.0, 200.0, 120.0, 70.0)
DAMPING = (40.0, 40.0, 25.0, 20.0, 10.0, 8.0, 5.0)
VISCOUS = (0.5, 0.5, 0.5, 0.5, 0.25, 0.25, 0.25)
COULOMB = (0.6, 0.9, 0.6, 1.2, 0.8, 0.3, 0.5)
SIGN_WIDTH = 0.01
ROTOR_INERTIA = 0.1


@dataclass(frozen=True)
class Setup:
    """An arm of rigid bodies without rotors, its drives and gains, and its posture (n,) [rad]."""

    arm: SimulatedArm
    drives: Drives
    gains: Gains
    posture: Array


def panda_setup(n_joints: int = 7) -> Setup:
    """
    Return the first joints of a Panda.

    LipIdError if pinocchio or example-robot-data is not installed, DataError if `n_joints` is out
    of range.
    """
    stiffness, damping, viscous, coulomb, posture = (
        np.array(values[:n_joints]) for values in (STIFFNESS, DAMPING, VISCOUS, COULOMB, POSTURE)
    )
    drives = Drives(
        rotor_inertia=np.full(n_joints, ROTOR_INERTIA),
        friction=JointFriction(viscous, coulomb, SIGN_WIDTH),
        ripple=0.02,
        position_noise=2e-5,
        velocity_noise=1e-3,
        torque_noise=0.05,
        delay=1,
    )
    return Setup(panda(n_joints), drives, Gains(stiffness, damping), posture)
