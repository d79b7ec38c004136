"""A simulated Panda that follows motions by torques, with drives and sensors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks._changed_arms import JointFriction, with_rotors
from lip_id_ros.arrays import Array
from lip_id_ros.recording import JointSamples
from lip_id_ros.simulation import panda, SimulatedArm, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION
from lip_id_ros.simulation.trajectories import Trajectory

STIFFNESS = np.array([600.0, 600.0, 400.0, 300.0, 200.0, 120.0, 70.0])
DAMPING = np.array([40.0, 40.0, 25.0, 20.0, 10.0, 8.0, 5.0])
"""Of the feedback [N m/rad, N m s/rad]: a maker's model has errors as large as the paper's."""

VISCOUS = np.array([0.5, 0.5, 0.5, 0.5, 0.25, 0.25, 0.25])
COULOMB = np.array([0.6, 0.9, 0.6, 1.2, 0.8, 0.3, 0.5])
SIGN_WIDTH, ROTOR_INERTIA = 0.01, 0.1  # rad/s, kg m^2
RIPPLE, POSITION_NOISE, VELOCITY_NOISE, TORQUE_NOISE = 0.02, 2e-5, 1e-3, 0.05
"""Standard deviations [N m, rad, rad/s, N m]; the first of the torque that acts."""

STEP_S = 1e-3
"""Between two commands; each acts a step later, and is held for one."""


class DrivenPanda:
    """
    The first joints of a Panda, at the beginning of a motion and with the torque it needs there.

    A step is one of fourth-order Runge-Kutta. `q`, `dq`: the exact state.
    """

    def __init__(self, motion: Trajectory, n_joints: int, rng: np.random.Generator) -> None:
        self.bodies = with_rotors(panda(n_joints), np.full(n_joints, ROTOR_INERTIA))
        self._friction = JointFriction(VISCOUS[:n_joints], COULOMB[:n_joints], SIGN_WIDTH)
        self._rng = rng
        q, dq, ddq = motion.sample(np.zeros(1))
        self.q, self.dq = q[0], dq[0]
        needed = self.bodies.inverse_dynamics(q, dq, ddq) + self._friction.torque(dq)
        self._acting = self._underway = needed[0]

    def measure(self) -> Array:
        """Return positions, velocities and torques as the sensors have them, shape (3, n)."""
        return np.array(
            [
                self._noisy(self.q, POSITION_NOISE),
                self._noisy(self.dq, VELOCITY_NOISE),
                self._noisy(self._acting, TORQUE_NOISE),
            ]
        )

    def step(self, command: Array, external: Array | float = 0.0) -> None:
        """Advance by a step; torques (n,) of a contact act at once and are not measured."""
        self._acting = self._noisy(self._underway, RIPPLE)
        self._underway = np.array(command, dtype=np.float64)
        self.q, self.dq = self._moved(self._acting + external)

    def _moved(self, tau: Array) -> tuple[Array, Array]:
        h, q, dq = STEP_S, self.q, self.dq
        a1 = self._acceleration(q, dq, tau)
        v2 = dq + 0.5 * h * a1
        a2 = self._acceleration(q + 0.5 * h * dq, v2, tau)
        v3 = dq + 0.5 * h * a2
        a3 = self._acceleration(q + 0.5 * h * v2, v3, tau)
        v4 = dq + h * a3
        a4 = self._acceleration(q + h * v3, v4, tau)
        return q + h / 6 * (dq + 2 * v2 + 2 * v3 + v4), dq + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    def _acceleration(self, q: Array, dq: Array, tau: Array) -> Array:
        return self.bodies.forward_dynamics(q, dq, tau - self._friction.torque(dq))

    def _noisy(self, values: Array, std: float) -> Array:
        return values + std * self._rng.standard_normal(values.shape)


def feedback(wanted: Array, measured: Array) -> Array:
    """Return torques (n,) against errors of positions and velocities, the first rows of each."""
    n = wanted.shape[1]
    error = wanted[:2] - measured[:2]
    return np.asarray(STIFFNESS[:n] * error[0] + DAMPING[:n] * error[1])


def no_contact(t: float) -> float:
    """Nothing touches the arm."""
    return 0.0


def move(
    nominal: SimulatedArm,
    rng: np.random.Generator,
    seconds: float,
    contact: Callable[[float], Array | float] = no_contact,
) -> JointSamples:
    """
    Return measurements of random sums of sinusoids, followed with the torques of a nominal arm.

    `contact` gives external torques (n,) at a time [s].
    """
    n_joints, n_steps = nominal.n_joints, round(seconds / STEP_S)
    trajectory = SinusoidTrajectory.random(MOTION.first(n_joints), rng)
    driven = DrivenPanda(trajectory, n_joints, rng)
    t = STEP_S * np.arange(n_steps, dtype=np.float64)
    wanted = np.array(trajectory.sample(t)).swapaxes(0, 1)
    measured = np.empty_like(wanted)
    for k, (at, states) in enumerate(zip(t, wanted, strict=True)):
        measured[k] = driven.measure()
        feedforward = nominal.inverse_dynamics(*states[:, np.newaxis])[0]
        driven.step(feedforward + feedback(states, measured[k]), contact(at))
    q, dq, tau = measured.swapaxes(0, 1)
    return JointSamples(t, q, dq, tau, nominal.joint_names, source='simulation')
