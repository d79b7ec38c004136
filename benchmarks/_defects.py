"""Recordings of simulated Pandas, sound ones and with defects of three sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, lfilter

from benchmarks._changed_arms import (
    FrictionalArm,
    JointFriction,
    with_gravity,
    with_payload,
    with_wrong_masses,
)
from lip_id_ros.arrays import Array
from lip_id_ros.recording import JointSamples
from lip_id_ros.simulation.arm import MOTION, panda, SimulatedArm
from lip_id_ros.simulation.trajectories import MotionLimits, SinusoidTrajectory

RATE_HZ, SECONDS = 100.0, 60.0
POSITION_NOISE, VELOCITY_NOISE, EFFORT_NOISE = 1e-5, 2e-3, 0.05
VISCOUS = np.array([2.0, 2.0, 1.5, 1.5, 0.5, 0.5, 0.5])
COULOMB = np.array([2.0, 2.0, 1.5, 1.5, 0.8, 0.8, 0.8])
RATES_HZ, LENGTHS_S, LOG_NOISE = (50.0, 100.0, 250.0, 500.0), (30.0, 120.0), np.log([0.3, 3.0])
JOINTS = range(4, 8)
DEGREES = 180.0 / np.pi
SWAY_HZ = 0.45


@dataclass(frozen=True)
class Sensors:
    """How a recording samples a motion; the noise is a factor of the usual one."""

    rate_hz: float = RATE_HZ
    seconds: float = SECONDS
    noise: float = 1.0

    @classmethod
    def random(cls, rng: np.random.Generator) -> Sensors:
        """Draw usual ones."""
        rate_hz, seconds = rng.choice(RATES_HZ), rng.uniform(*LENGTHS_S)
        return cls(float(rate_hz), float(seconds), float(np.exp(rng.uniform(*LOG_NOISE))))

    @property
    def times(self) -> Array:
        """Stamps of the samples [s]."""
        return np.arange(round(self.seconds * self.rate_hz)) / self.rate_hz


@dataclass(frozen=True, eq=False)
class Recorded:
    """A sound recording, and what it was made of."""

    samples: JointSamples
    arm: SimulatedArm
    friction: JointFriction
    motion: tuple[Array, Array, Array]
    seed: int

    @classmethod
    def of(cls, seed: int, n_joints: int, sensors: Sensors | None = None) -> Recorded:
        """Simulate an arm, its friction, its motion and its sensors."""
        sensors = sensors or Sensors()
        rng = np.random.default_rng(seed)
        arm = with_wrong_masses(panda(n_joints), 0.3, 0.05, rng)
        size = rng.uniform(0.3, 1.5, (2, n_joints))
        friction = JointFriction(size[0] * VISCOUS[:n_joints], size[1] * COULOMB[:n_joints])
        parts = (getattr(MOTION, name) for name in ('q_min', 'q_max', 'dq_max', 'ddq_max'))
        limits = MotionLimits(*(part[:n_joints] for part in parts))
        motion = SinusoidTrajectory.random(limits, rng).sample(sensors.times)
        samples = _measured(arm, friction, motion, seed, sensors)
        return cls(samples, arm, friction, motion, seed)

    def of_arm(self, arm: SimulatedArm) -> Array:
        """Return the efforts of another arm on the same motion."""
        return _measured(arm, self.friction, self.motion, self.seed).effort

    def shrunk(self, share: float) -> JointSamples:
        """Return a smaller motion of the same arm around its mean."""
        middle = self.motion[0].mean(axis=0)
        q, dq, ddq = self.motion
        small = middle + share * (q - middle), share * dq, share * ddq
        return _measured(self.arm, self.friction, small, self.seed)


def _measured(
    arm: SimulatedArm,
    friction: JointFriction,
    motion: tuple[Array, Array, Array],
    seed: int,
    sensors: Sensors | None = None,
) -> JointSamples:
    sensors, shape = sensors or Sensors(), motion[0].shape
    rng = np.random.default_rng((seed, 1))
    effort = FrictionalArm(arm, friction).inverse_dynamics(*motion)
    return JointSamples(
        t=sensors.times,
        position=motion[0] + sensors.noise * POSITION_NOISE * rng.standard_normal(shape),
        velocity=motion[1] + sensors.noise * VELOCITY_NOISE * rng.standard_normal(shape),
        effort=effort + sensors.noise * EFFORT_NOISE * rng.standard_normal(shape),
        joint_names=tuple(f'joint_{k + 1}' for k in range(shape[1])),
        source='simulated',
    )


Spoil = Callable[[Recorded, float], JointSamples]


def _effort(recorded: Recorded, joint: int, values: Array) -> JointSamples:
    effort = recorded.samples.effort.copy()
    effort[:, joint] = values
    return replace(recorded.samples, effort=effort)


def _alternating(recorded: Recorded, every: float) -> JointSamples:
    samples = recorded.samples
    other = np.arange(samples.n_samples)[:, np.newaxis] % int(every) == 0
    return replace(samples, position=np.where(other, 0.0, samples.position))


def _copied(recorded: Recorded, noise: float) -> JointSamples:
    effort = recorded.samples.effort
    draws = np.random.default_rng(0).standard_normal(len(effort))
    return _effort(recorded, 1, 0.7 * effort[:, 2] + noise * effort[:, 2].std() * draws)


def _in_degrees(recorded: Recorded, share: float) -> JointSamples:
    small = recorded.shrunk(share)
    return replace(small, position=DEGREES * small.position, velocity=DEGREES * small.velocity)


def _in_revolutions(recorded: Recorded, share: float) -> JointSamples:
    small, turns = recorded.shrunk(share), 0.5 / np.pi
    return replace(small, position=turns * small.position, velocity=turns * small.velocity)


def _velocities(recorded: Recorded, factor: float) -> JointSamples:
    return replace(recorded.samples, velocity=factor * recorded.samples.velocity)


def _times(recorded: Recorded, factor: float) -> JointSamples:
    return replace(recorded.samples, t=factor * recorded.samples.t)


def _turned(recorded: Recorded, joint: float) -> JointSamples:
    return _effort(recorded, int(joint), -recorded.samples.effort[:, int(joint)])


def _exchanged(recorded: Recorded, joint: float) -> JointSamples:
    order = np.arange(recorded.samples.n_joints)
    order[[int(joint), int(joint) + 1]] = int(joint) + 1, int(joint)
    return replace(recorded.samples, effort=recorded.samples.effort[:, order])


def _unsigned(recorded: Recorded, joints: float) -> JointSamples:
    some = np.arange(recorded.samples.n_joints) < joints
    effort = recorded.samples.effort
    return replace(recorded.samples, effort=np.where(some, np.abs(effort), effort))


def _clipped(recorded: Recorded, percent: float) -> JointSamples:
    effort = recorded.samples.effort
    noise = EFFORT_NOISE * np.random.default_rng(0).standard_normal(effort.shape)
    ends = np.percentile(effort, [percent, 100.0 - percent], axis=0)
    return replace(recorded.samples, effort=np.clip(effort, *ends) + noise)


def _payload(recorded: Recorded, mass: float) -> JointSamples:
    loaded = recorded.of_arm(with_payload(recorded.arm, mass, np.array([0.0, 0.0, 0.1])))
    is_loaded = (recorded.samples.t % 8.0 < 4.0)[:, np.newaxis]
    return replace(recorded.samples, effort=np.where(is_loaded, loaded, recorded.samples.effort))


def _rocking(recorded: Recorded, degrees: float) -> JointSamples:
    tilt = np.sin(degrees / DEGREES)
    tilted = recorded.of_arm(with_gravity(recorded.arm, np.array([9.81 * tilt, 0.0, -9.81])))
    sway = np.sin(2.0 * np.pi * SWAY_HZ * recorded.samples.t)[:, np.newaxis]
    effort = recorded.samples.effort
    return replace(recorded.samples, effort=effort + sway * (tilted - effort))


def _rated(recorded: Recorded, ratio: float) -> JointSamples:
    ratings = 0.87 * ratio ** -np.resize([0.0, 1.0], recorded.samples.n_joints)
    return replace(recorded.samples, effort=recorded.samples.effort / ratings)


def _drifting(recorded: Recorded, per_minute: float) -> JointSamples:
    drift = per_minute / 60.0 * recorded.samples.t[:, np.newaxis]
    return replace(recorded.samples, effort=recorded.samples.effort + drift)


def _delayed(recorded: Recorded, seconds: float) -> JointSamples:
    t, effort = recorded.samples.t, recorded.samples.effort
    late = [np.interp(t - seconds, t, column) for column in effort.T]
    return replace(recorded.samples, effort=np.column_stack(late))


def _delayed_alone(recorded: Recorded, seconds: float) -> JointSamples:
    return _effort(recorded, 1, _delayed(recorded, seconds).effort[:, 1])


def _held(recorded: Recorded, rate_hz: float) -> JointSamples:
    period, count = round(RATE_HZ / rate_hz), recorded.samples.n_samples
    return _effort(recorded, 1, recorded.samples.effort[period * (np.arange(count) // period), 1])


def _low_passed(recorded: Recorded, cutoff_hz: float) -> JointSamples:
    low, samples = butter(1, cutoff_hz, fs=RATE_HZ), recorded.samples
    start = samples.position[0]
    position = start + lfilter(*low, samples.position - start, axis=0)
    return replace(samples, position=position, velocity=lfilter(*low, samples.velocity, axis=0))


DEFECTS: dict[str, tuple[Spoil, tuple[float, float, float], set[str]]] = {
    'another publisher, every n-th sample': (_alternating, (10, 4, 2), {'alternating'}),
    'effort of joint 2 that of joint 3, plus noise of': (
        _copied,
        (0.01, 0.001, 0.0),
        {'effort_copied'},
    ),
    'degrees, motion times': (_in_degrees, (0.1, 0.2, 0.5), {'position_degrees', 'position_unit'}),
    'revolutions, motion times': (_in_revolutions, (0.1, 0.2, 0.5), {'position_unit'}),
    'velocities times': (_velocities, (1.05, 1.1, 1.2), {'velocity_scale'}),
    'times of the clock times': (_times, (1.05, 1.1, 1.2), {'velocity_scale'}),
    'sign of one effort turned, index': (_turned, (3, 2, 1), {'effort_sign'}),
    'efforts of neighbours exchanged, index': (_exchanged, (2, 1, 0), {'effort_exchanged'}),
    'unsigned efforts, joints': (_unsigned, (1, 2, 7), {'effort_unsigned'}),
    'clipped below noise, percent at each end': (_clipped, (2, 5, 10), {'effort_clipped'}),
    'payload every 4 s [kg]': (_payload, (1, 3, 6), set()),
    'base that rocks [deg]': (_rocking, (1, 2, 5), set()),
    'percent of ratings, ratio of neighbours': (_rated, (1.5, 3, 6), set()),
    'offsets that drift [N m/min]': (_drifting, (1, 3, 8), set()),
    'efforts late [s]': (_delayed, (0.02, 0.05, 0.08), {'effort_delay'}),
    'effort of joint 2 late [s]': (_delayed_alone, (0.03, 0.05, 0.08), {'effort_delay'}),
    'effort of joint 2 held [Hz]': (_held, (50, 20, 10), {'effort_held'}),
    'positions low-passed [Hz]': (_low_passed, (10, 5, 2), {'effort_delay'}),
}
"""How to spoil a recording, the sizes from small to large, and which findings are right."""


CAUTIONS = {
    'revolutions, motion times': 'in revolutions',
    'payload every 4 s [kg]': 'a payload that was taken up',
    'base that rocks [deg]': 'A base that tilts',
    'percent of ratings, ratio of neighbours': 'efforts seem to be motor currents',
    'offsets that drift [N m/min]': 'Offsets of efforts drift',
}
"""Parts of the sentences with which a fit reports what no finding does."""
