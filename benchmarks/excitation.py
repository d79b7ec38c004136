"""
Errors after a designed motion, beside random ones within the same limits (excitation.md).

Simulated arms with friction, rotors and gears follow a motion; a model is fitted to what was
measured, and judged by the torques of unseen random motions within the same limits. What is left
after learning from the unseen motions themselves is what no motion cures. With `--designs`, how
high and how far apart the links of four real arms stay in so many designs.

"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import product
from pathlib import Path
import time

import numpy as np

from benchmarks._designs import ARMS, designs
from benchmarks._effects import driven, Drives, INDUSTRIAL, MILD
from benchmarks._results import Results, Row
from benchmarks.baselines import method
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.description.limits import joint_ranges
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.excitation.joint_limits import JointLimits, limits_from
from lip_id_ros.excitation.planning import design_motion
from lip_id_ros.excitation.series import FourierMotion, LimitedMotions
from lip_id_ros.excitation.settings import ExcitationConfig, MotionSettings, SearchSettings
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation.arm import panda_urdf, SimulatedArm

ROBOTS = {'Panda': ('panda_description/urdf/panda.urdf', 7),
          'UR10': ('ur_description/urdf/ur10_robot.urdf', 6)}  # fmt: skip
EFFECTS = {'mild': MILD, 'industrial': INDUSTRIAL}
LEARNERS = ('rigid_body', 'rigid_body_friction', 'articulated')
"""Least squares with the true chain, without and with selection of friction; the default fit."""

MOTIONS = ('designed', 'random 0', 'random 1', 'random 2', 'random 40 s', 'unseen')
RANDOM = MOTIONS[1:4]

SECONDS, RATE_HZ = 20.0, 100.0
TESTS, TEST_SEED = 5, 10_000
REACH, SHARE = 2.5, 0.8
"""A joint moves at most so far from its middle [rad], and over this share of its range."""

VELOCITY, ACCELERATION = 2.0, 10.0
NOISE = 0.004
"""Standard deviation of torques, in the largest torque of the URDF."""


@dataclass(frozen=True, eq=False)
class Arm:
    """A simulated arm with its drives, and the limits of its motions."""

    dynamics: SimulatedArm
    drives: Drives
    urdf: Path
    motion: MotionSettings
    noise: Array

    @property
    def limits(self) -> JointLimits:
        """Limits of the motions."""
        m = self.motion
        return limits_from(m, m.joints)

    def record(self, motion: FourierMotion, rng: np.random.Generator) -> Dataset:
        """Return what is measured along a motion, with the torques without noise."""
        t = np.arange(round(motion.duration * RATE_HZ)) / RATE_HZ
        motor, tau = driven(self.dynamics, self.drives, motion.sample(t), 1.0 / RATE_HZ)
        q, dq, ddq = motor
        return Dataset(
            t=t, q=q, dq=dq, ddq=ddq,
            tau=tau + self.noise * rng.standard_normal(tau.shape),
            joint_names=self.dynamics.joint_names,
            joint_types=self.dynamics.joint_types,
            segment=np.zeros(len(t), dtype=np.int64),
            tau_noiseless=tau,
        )  # fmt: skip


def arm_of(robot: str, effects: str) -> Arm:
    """Return a robot of example-robot-data with drives."""
    path, n = ROBOTS[robot]
    urdf = panda_urdf().parents[2] / path
    dynamics = SimulatedArm(urdf, n)
    drives = EFFECTS[effects].first(n)
    ranges = joint_ranges(urdf.read_text(), str(urdf), dynamics.joint_names)
    low, high = np.array(ranges.lower), np.array(ranges.upper)
    middle, half = (low + high) / 2, np.minimum(SHARE * (high - low) / 2, REACH)
    velocity = np.minimum(SHARE * np.array(ranges.velocity), VELOCITY)
    motion = MotionSettings(
        joints=dynamics.joint_names,
        duration_s=SECONDS,
        lower=tuple(middle - half),
        upper=tuple(middle + half),
        velocity=tuple(velocity),
        acceleration=(ACCELERATION,),
        jerk=(10.0 * ACCELERATION,),
        size=1.0,
    )
    return Arm(dynamics, drives, urdf, motion, NOISE * np.array(ranges.effort))


def random_motion(arm: Arm, seed: int, seconds: float = SECONDS) -> FourierMotion:
    """Draw a motion within the limits; a longer one has as many harmonics per second."""
    limits = arm.limits
    harmonics = round(arm.motion.harmonics * seconds / SECONDS)
    posture = 0.5 * (limits.lower + limits.upper)
    motions = LimitedMotions(limits, posture, seconds, harmonics)
    return motions.random(np.random.default_rng([seed, 77]))


@cache
def chosen_motion(robot: str, name: str, seed: int) -> FourierMotion:
    """Return the motion to learn from, which is the same with any drives."""
    arm = arm_of(robot, 'mild')
    if name.startswith('random'):
        if name == 'random 40 s':
            return random_motion(arm, 1000 * seed + 100, 2.0 * SECONDS)
        return random_motion(arm, 1000 * seed + int(name.split()[1]))
    config = ExcitationConfig(arm.motion, search=SearchSettings(seed=seed))
    return design_motion(config).motion


@cache
def unseen(robot: str, effects: str) -> list[Dataset]:
    """Return recordings of the motions that models are judged on."""
    arm = arm_of(robot, effects)
    return [
        arm.record(random_motion(arm, TEST_SEED + k), np.random.default_rng(k))
        for k in range(TESTS)
    ]


def training(robot: str, effects: str, name: str, seed: int) -> Dataset:
    """Return what is measured along a motion to learn from."""
    if name == 'unseen':
        return concatenate(unseen(robot, effects))
    motion = chosen_motion(robot, name, seed)
    return arm_of(robot, effects).record(motion, np.random.default_rng(seed))


def measured(case: tuple[str, str, str], name: str, seed: int) -> Row:
    """Fit a model to one motion, and return its errors on unseen ones [%], joint by joint."""
    robot, effects, learner = case
    train = training(robot, effects, name, seed)
    started = time.process_time()
    model = method(learner, arm_of(robot, effects).urdf).fit(train, FitSettings(seed=seed), silent)
    fitted_s = time.process_time() - started
    errors = []
    for test in unseen(robot, effects):
        assert test.tau_noiseless is not None
        errors.append(
            nmse_percent(model.predict(test.q, test.dq, test.ddq).tau, test.tau_noiseless)
        )
    return {'nmse': np.mean(errors, axis=0).tolist(), 'fit_cpu_s': fitted_s}


def table(rows: Mapping[str, Row], cases: list[tuple[str, str, str]], seeds: list[int]) -> None:
    """Print geometric means over joints, and their ratios to random motions of 20 s, by seeds."""
    header = ('Arm', 'Drives', 'Learner', 'Motion', 'Seeds', 'nMSE [%]', 'in random', 'range')
    print(f'| {" | ".join(header)} |\n|{"---|" * len(header)}')
    for case in cases:
        means = {
            name: np.array([_mean(rows, case, name, seed) for seed in seeds]) for name in MOTIONS
        }
        usual = np.exp(np.mean([np.log(means[name]) for name in RANDOM], axis=0))
        means['random'] = usual
        for name in ('random', *(each for each in MOTIONS if each not in RANDOM)):
            known = np.isfinite(means[name]) & np.isfinite(usual)
            if not known.any():
                continue
            ratios = (means[name] / usual)[known]
            value, of_random = np.median(means[name][known]), np.median(ratios)
            print(
                f'| {" | ".join(case)} | {name} | {known.sum()} | {value:.3g} | '
                f'{of_random:.2f} | {ratios.min():.2f} to {ratios.max():.2f} |'
            )


def _mean(rows: Mapping[str, Row], case: tuple[str, str, str], name: str, seed: int) -> float:
    """Return the geometric mean over the joints [%]; not a number where it was not measured."""
    found = rows.get(_key(case, name, seed))
    return np.nan if found is None else float(np.exp(np.mean(np.log(found['nmse']))))


def _key(case: tuple[str, str, str], name: str, seed: int) -> str:
    seed = 0 if name == 'unseen' else seed
    return ' | '.join((*case, name, str(seed)))


def main(arguments: list[str]) -> int:
    """Measure what is not in the file of results yet, and print the table."""
    parser = argparse.ArgumentParser(prog='benchmarks excitation', description=__doc__)
    parser.add_argument('--results', type=Path, default=Path('excitation.json'))
    parser.add_argument('--robots', nargs='+', choices=ROBOTS, default=list(ROBOTS))
    parser.add_argument('--effects', nargs='+', choices=EFFECTS, default=list(EFFECTS))
    parser.add_argument('--learners', nargs='+', choices=LEARNERS, default=list(LEARNERS))
    parser.add_argument('--seeds', nargs='+', type=int, default=[0, 1, 2])
    parser.add_argument('--designs', type=int, default=0, help='look at so many of each arm')
    parser.add_argument('--arms', nargs='+', choices=ARMS, default=list(ARMS))
    parser.add_argument('--data', type=Path, default=Path('../shared/data'))
    options = parser.parse_args(arguments)
    if options.designs:
        designs(options.designs, options.arms, options.data)
        return 0
    results = Results(options.results)
    cases = list(product(options.robots, options.effects, options.learners))
    for seed, case, name in product(options.seeds, cases, MOTIONS):
        results.row(_key(case, name, seed), partial(measured, case, name, seed))
    table(results.rows, cases, options.seeds)
    return 0
