"""What sensors make of a motion, and the pipeline of that: filter, differentiate, decimate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from benchmarks._effects import driven, Drives, LARGEST
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.simulation.arm import Dynamics
from lip_id_ros.simulation.trajectories import Trajectory

SECONDS, RATE_HZ = 50.0, 200.0


@dataclass(frozen=True)
class Sensors:
    """
    White noise and quantisation of the readings.

    Attributes
    ----------
    torque_step, torque_noise : ndarray, shape (n,)
        [N m].
    position_step, position_noise : float
        [rad].
    velocity_noise : float
        [rad/s].

    """

    torque_step: Array
    torque_noise: Array
    position_step: float = 2 * np.pi / 2**17
    position_noise: float = 2e-5
    velocity_noise: float = 2e-3


TORQUE_SENSORS = Sensors(np.full(7, 0.01), np.full(7, 0.1))
MOTOR_CURRENTS = Sensors(2 * LARGEST / 2**12, 0.005 * LARGEST)


def measured(
    arm: Dynamics,
    drives: Drives,
    sensors: Sensors,
    trajectory: Trajectory,
    rng: np.random.Generator,
) -> Dataset:
    """
    Record a motion as a driver would, and prepare it as any recording is prepared.

    Parameters
    ----------
    arm : Dynamics
    drives : Drives
    sensors : Sensors
    trajectory : Trajectory
        Of the links; `SECONDS` are one period of it.
    rng : numpy.random.Generator
        The only source of chance.

    Returns
    -------
    Dataset
        Filtered, differentiated and decimated by default settings, with the truth beside it.

    """
    t = np.arange(round(SECONDS * RATE_HZ), dtype=np.float64) / RATE_HZ
    warm = drives.at_some_temperature(rng)
    run = driven(arm, warm, trajectory.sample(t), 1.0 / RATE_HZ)
    q, dq, _ = run.motor
    n = len(arm.joint_names)

    def noisy(values: Array, std: float | Array) -> Array:
        return values + std * rng.standard_normal(values.shape)

    samples = JointSamples(
        t=t,
        position=_stepped(noisy(q, sensors.position_noise), sensors.position_step),
        velocity=noisy(dq, sensors.velocity_noise),
        effort=_stepped(noisy(run.tau, sensors.torque_noise[:n]), sensors.torque_step[:n]),
        joint_names=arm.joint_names,
    )
    found = preprocess(samples)
    rows = np.round(found.t * RATE_HZ).astype(np.int64)
    return replace(
        found,
        tau_noiseless=run.tau[rows],
        kinetic=run.kinetic[rows],
        potential=run.potential[rows],
        provenance=found.provenance,
    )


def _stepped(values: Array, step: float | Array) -> Array:
    return np.asarray(step * np.round(values / step))
