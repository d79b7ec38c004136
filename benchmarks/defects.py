"""
How often `lip_id inspect` and `lip_id fit` find defects of three sizes in simulated recordings.

And what they find in sound ones, which have other rates, lengths and noise, and in real ones.

"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter

from benchmarks._arms import (
    FrictionalArm,
    JointFriction,
    with_gravity,
    with_payload,
    with_wrong_masses,
)
from benchmarks._real import ARMS, OTHERS
from lip_id_ros.arrays import Array
from lip_id_ros.evaluation.cautions import fit_cautions
from lip_id_ros.health import evidence_of, examine
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings
from lip_id_ros.simulation.arm import MOTION, panda, SimulatedArm
from lip_id_ros.simulation.trajectories import SinusoidTrajectory
from lip_id_ros.workflow.fit import fit

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
        rng, sensors = np.random.default_rng(seed), sensors or Sensors()
        arm = with_wrong_masses(panda(n_joints), 0.3, 0.05, rng)
        size = rng.uniform(0.3, 1.5, (2, n_joints))
        friction = JointFriction(size[0] * VISCOUS[:n_joints], size[1] * COULOMB[:n_joints])
        motion = SinusoidTrajectory.random(MOTION.first(n_joints), rng).sample(sensors.times)
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

DEFECTS: dict[str, tuple[Spoil, tuple[float, float, float], set[str]]] = {}
"""How to spoil a recording, the sizes from small to large, and which findings are right."""


def defect(name: str, sizes: tuple[float, float, float], *right: str) -> Callable[[Spoil], Spoil]:
    """Put a function into `DEFECTS`."""

    def add(spoil: Spoil) -> Spoil:
        DEFECTS[name] = spoil, sizes, set(right)
        return spoil

    return add


def _with(recorded: Recorded, effort: Array, joint: int | None = None) -> JointSamples:
    """Return a recording with other efforts, of one joint or all."""
    if joint is not None:
        effort = np.where(
            np.arange(recorded.samples.n_joints) == joint, effort[:, None], recorded.samples.effort
        )
    return replace(recorded.samples, effort=effort)


@defect('another publisher, every n-th sample', (10, 4, 2), 'alternating')
def _alternating(recorded: Recorded, every: float) -> JointSamples:
    samples = recorded.samples
    other = np.arange(samples.n_samples)[:, np.newaxis] % int(every) == 0
    return replace(samples, position=np.where(other, 0.0, samples.position))


@defect('effort of joint 2 that of joint 3, plus noise of', (0.01, 0.001, 0.0), 'effort_copied')
def _copied(recorded: Recorded, noise: float) -> JointSamples:
    other = recorded.samples.effort[:, 2]
    draws = np.random.default_rng(0).standard_normal(len(other))
    return _with(recorded, 0.7 * other + noise * other.std() * draws, 1)


def _in_units(recorded: Recorded, share: float, unit: float) -> JointSamples:
    small = recorded.shrunk(share)
    return replace(small, position=unit * small.position, velocity=unit * small.velocity)


@defect('degrees, motion times', (0.1, 0.2, 0.5), 'position_degrees', 'position_unit')
def _in_degrees(recorded: Recorded, share: float) -> JointSamples:
    return _in_units(recorded, share, DEGREES)


@defect('revolutions, motion times', (0.1, 0.2, 0.5), 'position_unit')
def _in_revolutions(recorded: Recorded, share: float) -> JointSamples:
    return _in_units(recorded, share, 0.5 / np.pi)


@defect('velocities times', (1.05, 1.1, 1.2), 'velocity_scale')
def _velocities(recorded: Recorded, factor: float) -> JointSamples:
    return replace(recorded.samples, velocity=factor * recorded.samples.velocity)


@defect('times of the clock times', (1.05, 1.1, 1.2), 'velocity_scale')
def _times(recorded: Recorded, factor: float) -> JointSamples:
    return replace(recorded.samples, t=factor * recorded.samples.t)


@defect('sign of one effort turned, index', (3, 2, 1), 'effort_sign')
def _turned(recorded: Recorded, joint: float) -> JointSamples:
    return _with(recorded, -recorded.samples.effort[:, int(joint)], int(joint))


@defect('efforts of neighbours exchanged, index', (2, 1, 0), 'effort_exchanged')
def _exchanged(recorded: Recorded, joint: float) -> JointSamples:
    order = np.arange(recorded.samples.n_joints)
    order[[int(joint), int(joint) + 1]] = int(joint) + 1, int(joint)
    return _with(recorded, recorded.samples.effort[:, order])


@defect('unsigned efforts, joints', (1, 2, 7), 'effort_unsigned')
def _unsigned(recorded: Recorded, joints: float) -> JointSamples:
    some, effort = np.arange(recorded.samples.n_joints) < joints, recorded.samples.effort
    return _with(recorded, np.where(some, np.abs(effort), effort))


@defect('clipped below noise, percent at each end', (2, 5, 10), 'effort_clipped')
def _clipped(recorded: Recorded, percent: float) -> JointSamples:
    effort = recorded.samples.effort
    noise = EFFORT_NOISE * np.random.default_rng(0).standard_normal(effort.shape)
    ends = np.percentile(effort, [percent, 100.0 - percent], axis=0)
    return _with(recorded, np.clip(effort, *ends) + noise)


@defect('payload every 4 s [kg]', (1, 3, 6))
def _payload(recorded: Recorded, mass: float) -> JointSamples:
    loaded = recorded.of_arm(with_payload(recorded.arm, mass, np.array([0.0, 0.0, 0.1])))
    is_loaded = (recorded.samples.t % 8.0 < 4.0)[:, np.newaxis]
    return _with(recorded, np.where(is_loaded, loaded, recorded.samples.effort))


@defect('base that rocks [deg]', (1, 2, 5))
def _rocking(recorded: Recorded, degrees: float) -> JointSamples:
    tilt, effort = np.sin(degrees / DEGREES), recorded.samples.effort
    tilted = recorded.of_arm(with_gravity(recorded.arm, np.array([9.81 * tilt, 0.0, -9.81])))
    sway = np.sin(2.0 * np.pi * SWAY_HZ * recorded.samples.t)[:, np.newaxis]
    return _with(recorded, effort + sway * (tilted - effort))


@defect('percent of ratings, ratio of neighbours', (1.5, 3, 6))
def _rated(recorded: Recorded, ratio: float) -> JointSamples:
    ratings = 0.87 * ratio ** -np.resize([0.0, 1.0], recorded.samples.n_joints)
    return _with(recorded, recorded.samples.effort / ratings)


@defect('offsets that drift [N m/min]', (1, 3, 8))
def _drifting(recorded: Recorded, per_minute: float) -> JointSamples:
    drift = per_minute / 60.0 * recorded.samples.t[:, np.newaxis]
    return _with(recorded, recorded.samples.effort + drift)


@defect('efforts late [s]', (0.02, 0.05, 0.08), 'effort_delay')
def _delayed(recorded: Recorded, seconds: float) -> JointSamples:
    t, effort = recorded.samples.t, recorded.samples.effort
    return _with(recorded, np.column_stack([np.interp(t - seconds, t, x) for x in effort.T]))


@defect('effort of joint 2 late [s]', (0.03, 0.05, 0.08), 'effort_delay')
def _delayed_alone(recorded: Recorded, seconds: float) -> JointSamples:
    return _with(recorded, _delayed(recorded, seconds).effort[:, 1], 1)


@defect('effort of joint 2 held [Hz]', (50, 20, 10), 'effort_held')
def _held(recorded: Recorded, rate_hz: float) -> JointSamples:
    period, count = round(RATE_HZ / rate_hz), recorded.samples.n_samples
    return _with(recorded, recorded.samples.effort[period * (np.arange(count) // period), 1], 1)


@defect('positions low-passed [Hz]', (10, 5, 2), 'effort_delay')
def _low_passed(recorded: Recorded, cutoff_hz: float) -> JointSamples:
    low, samples = butter(1, cutoff_hz, fs=RATE_HZ), recorded.samples
    start = samples.position[0]
    position = start + lfilter(*low, samples.position - start, axis=0)
    return replace(samples, position=position, velocity=lfilter(*low, samples.velocity, axis=0))


CAUTIONS = {
    'revolutions, motion times': 'in revolutions',
    'payload every 4 s [kg]': 'a payload that was taken up',
    'base that rocks [deg]': 'A base that tilts',
    'percent of ratings, ratio of neighbours': 'efforts seem to be motor currents',
    'offsets that drift [N m/min]': 'Offsets of efforts drift',
}
"""Parts of the sentences with which a fit reports what no finding does."""


def main(arguments: list[str]) -> int:
    """Print a line for the false alarms, and one for each defect with its three counts."""
    parser = argparse.ArgumentParser(prog='benchmarks defects', description=__doc__)
    parser.add_argument('--arms', type=int, default=20)
    parser.add_argument('--fits', type=int, default=0, help='arms whose recordings are fitted too')
    parser.add_argument('--joints', type=int, nargs='*', default=[4, 7], choices=JOINTS)
    parser.add_argument('--only', nargs='+', choices=tuple(DEFECTS), default=tuple(DEFECTS))
    parser.add_argument('--sound', type=int, default=200, help='sound recordings of any kind')
    parser.add_argument('--data', type=Path, help='folder of real recordings')
    options = parser.parse_args(arguments)
    for n_joints in options.joints:
        arms = [Recorded.of(seed, n_joints) for seed in range(max(options.arms, options.fits))]
        right = {name: DEFECTS[name][2] for name in options.only}
        for line in lines('inspect', found, arms[: options.arms], right):
            print(line, flush=True)
        right = {name: {CAUTIONS[name]} for name in options.only if name in CAUTIONS}
        for line in lines('fit', cautions, arms[: options.fits], right):
            print(line, flush=True)
    alarms = Counter(each for seed in range(options.sound) for each in found(sound(seed)))
    print(f'inspect of {options.sound} sound recordings: {dict(alarms)}', flush=True)
    for line in real(options.data) if options.data else ():
        print(line, flush=True)
    return 0


def sound(seed: int) -> JointSamples:
    """Return a sound recording of an arm of 4 to 7 joints, with any usual sensors."""
    rng = np.random.default_rng((seed, 2))
    n_joints = int(rng.choice(JOINTS))
    return Recorded.of(seed, n_joints, Sensors.random(rng)).samples


def real(folder: Path) -> Iterator[str]:
    """Yield for each kind of real recording how many there are, and findings in them."""
    for name, load in {**{name: arm.load for name, arm in ARMS.items()}, **OTHERS}.items():
        raw = load(folder)
        codes = Counter(code for each in raw.samples for code in found(each, raw.recording))
        yield f'{name}: {len(raw.samples)} recordings, {dict(codes)}'


def lines(
    verb: str,
    judge: Callable[[JointSamples], set[str]],
    arms: Sequence[Recorded],
    right: Mapping[str, set[str]],
) -> Iterator[str]:
    """Yield the rows of a table in Markdown: what is said of sound recordings, and of others."""
    alarms = Counter(each for arm in arms for each in judge(arm.samples))
    yield f'{verb} of {len(arms)} arms, false alarms: {dict(alarms)}'
    for name, names in right.items():
        spoil, sizes, _ = DEFECTS[name]
        cells = []
        for size in sizes:
            hits = sum(bool(names & judge(spoil(arm, size))) for arm in arms)
            cells.append(f'{size:g}: {hits}')
        yield f'| {name} | {" | ".join(cells)} |'


def found(samples: JointSamples, recording: RecordingSettings | None = None) -> set[str]:
    """Return the codes of errors and warnings."""
    findings = examine(evidence_of(samples, recording))
    return {finding.code for finding in findings if finding.severity != 'note'}


def cautions(samples: JointSamples) -> set[str]:
    """Return what a fit reports: parts of known sentences, and other sentences whole."""
    model = fit(preprocess(samples))
    texts = fit_cautions(model)
    return {next((part for part in CAUTIONS.values() if part in text), text) for text in texts}
