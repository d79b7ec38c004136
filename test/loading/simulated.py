"""Recordings of a simulated arm whose delays and noise are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.recording import JointSamples
from lip_id_ros.simulation.arm import panda, SimulatedArm
from lip_id_ros.simulation.trajectories import MotionLimits, SinusoidTrajectory

N_JOINTS = 4
RATE_HZ, SECONDS = 200.0, 20.0
FUNDAMENTAL_HZ, SINUSOIDS = 0.1, 12
TORQUE_NOISE = 0.005
"""Of each joint's torque."""

LIMITS = MotionLimits(
    np.full(N_JOINTS, -1.5), np.full(N_JOINTS, 1.5), np.full(N_JOINTS, 2.0), np.full(N_JOINTS, 8.0)
)
VISCOUS, COULOMB, TURNING = 1.0, 2.0, 0.05


def friction(dq: Array, coulomb: float) -> Array:
    """Return viscous and Coulomb friction with a smooth sign [N m]."""
    return np.asarray(VISCOUS * dq + coulomb * np.tanh(dq / TURNING))


@dataclass(frozen=True, eq=False)
class SimulatedRecording:
    """What sensors record, with the arm and its motion."""

    samples: JointSamples
    arm: SimulatedArm
    motion: SinusoidTrajectory
    coulomb: float

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the true torques of states, shape (N, n) [N m]."""
        return self.arm.inverse_dynamics(q, dq, ddq) + friction(dq, self.coulomb)


def simulated(
    seed: int,
    delays_s: Array,
    position_noise: float = 0.0,
    fastest: int = SINUSOIDS,
    coulomb: float = COULOMB,
) -> SimulatedRecording:
    """
    Record a motion of four joints of a Panda with friction.

    Efforts are measured later than positions, by `delays_s` (4,). White noise of positions is in
    rad, the fastest sinusoid in tenths of Hz, the Coulomb friction of every joint in N m.

    """
    rng = np.random.default_rng(seed)
    arm, t = panda(N_JOINTS), np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    motion = SinusoidTrajectory.random(LIMITS, rng, fastest, FUNDAMENTAL_HZ)
    columns = []
    for joint, delay in enumerate(delays_s):
        state = motion.sample(t - delay)
        columns.append((arm.inverse_dynamics(*state) + friction(state[1], coulomb))[:, joint])
    torque = np.stack(columns, axis=1)
    position = motion.sample(t)[0]
    samples = JointSamples(
        t=t,
        position=position + position_noise * rng.standard_normal(position.shape),
        velocity=np.full_like(position, np.nan),
        effort=torque + TORQUE_NOISE * torque.std(axis=0) * rng.standard_normal(torque.shape),
        joint_names=arm.joint_names,
    )
    return SimulatedRecording(samples, arm, motion, coulomb)
