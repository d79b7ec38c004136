"""The paper's comparisons: which data, which models, in a short form and in full."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from benchmarks._effects import Drives, INDUSTRIAL, MILD
from benchmarks._panda import half_ranges, run_pair
from benchmarks._sensors import measured, MOTOR_CURRENTS, Sensors, TORQUE_SENSORS
from benchmarks.comparison import Case, thinned
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation import MotionLimits, panda, SimulatedArm, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION, panda_urdf

UNSEEN = 'unseen motion'

BLACK_BOX = ('se', 'gip', 'lse', 'delan', 'lip', 'recursive', 'articulated')
FAST = tuple(name for name in BLACK_BOX if name != 'delan')


@dataclass(frozen=True)
class Form:
    """
    One size of an experiment.

    Attributes
    ----------
    cases : callable
        Makes them.
    models : tuple of str
    settings : FitSettings
    delan_steps : int

    """

    cases: Callable[[], Iterator[Case]]
    models: tuple[str, ...]
    settings: FitSettings
    delan_steps: int = 3000


def generalization(joints: tuple[int, ...], n_seeds: int) -> Iterator[Case]:
    """Section `sec:gen`: arms of several numbers of joints, an unseen motion for each seed."""
    for n_joints, seed in product(joints, range(n_seeds)):
        train, test = run_pair(n_joints, seed)
        group = f'{n_joints} joints'
        yield Case(f'{group}, seed {seed}', group, train, {UNSEEN: test})


def data_efficiency(n_joints: int, counts: tuple[int, ...], n_seeds: int) -> Iterator[Case]:
    """Section `sec:data_eff`: the same run, more and more of its samples."""
    for count, seed in product(counts, range(n_seeds)):
        train, test = run_pair(n_joints, seed)
        group = f'{count} samples'
        yield Case(f'{group}, seed {seed}', group, thinned(train, count), {UNSEEN: test})


@dataclass(frozen=True)
class Setting:
    """
    One arm, and how far its motions reach.

    Attributes
    ----------
    name : str
    drives : Drives
    sensors : Sensors
    known : MotionLimits
        Of the motions to learn from.
    farther : float
        How many times as far the unseen ones reach.

    """

    name: str
    drives: Drives
    sensors: Sensors
    known: MotionLimits
    farther: float

    def recorded(
        self, arm: SimulatedArm, n_tests: int, rng: np.random.Generator
    ) -> tuple[Dataset, dict[str, Dataset]]:
        """Record a motion to learn from and unseen ones."""
        n = arm.n_joints
        known = SinusoidTrajectory.random(self.known.first(n), rng, 100)
        limits = _farther(known, self.farther)

        def record(motion: SinusoidTrajectory) -> Dataset:
            return measured(arm, self.drives.first(n), self.sensors, motion, rng)

        train = record(known)
        tests = {
            f'{UNSEEN} {number + 1}': record(SinusoidTrajectory.random(limits, rng, 50))
            for number in range(n_tests)
        }
        return train, tests


def friction(n_joints: int, n_seeds: int, n_tests: int) -> Iterator[Case]:
    """
    Section `sec:real_melfa`, in simulation: effects that no energy describes, measured motions.

    Unseen motions reach farther than those learned from, at half the frequencies.

    """
    arm = panda(n_joints)
    for setting, seed in product(settings_of_friction(), range(n_seeds)):
        name = f'{setting.name}, seed {seed}'
        # smaller seeds are those that the defaults of the fit were chosen with
        train, tests = setting.recorded(arm, n_tests, np.random.default_rng(200 + seed))
        yield Case(name, setting.name, train, tests, panda_urdf())


def by_measured(cases: Iterable[Case]) -> Iterator[Case]:
    """Have models judged by the measured, filtered torques, as those of a real arm."""
    for case in cases:
        tests = {name: replace(test, tau_noiseless=None) for name, test in case.tests.items()}
        yield replace(case, tests=tests)


def settings_of_friction() -> tuple[Setting, ...]:
    """Return the arms of the experiment; comparison.md explains them."""
    wide, narrow = _within(MOTION, 0.7), _within(half_ranges(7), 0.6)
    return (
        Setting('motor currents, 1.4 times as far', INDUSTRIAL, MOTOR_CURRENTS, wide, 1.4),
        Setting('motor currents, 2.4 times as far', INDUSTRIAL, MOTOR_CURRENTS, narrow, 2.4),
        Setting('small effects, 2.4 times as far', MILD, TORQUE_SENSORS, narrow, 2.4),
    )


def _within(limits: MotionLimits, share: float) -> MotionLimits:
    return _around(limits, share * (limits.q_max - limits.q_min) / 2)


def _farther(known: SinusoidTrajectory, times: float) -> MotionLimits:
    q, _, _ = known.sample(np.arange(0.0, known.period, 0.01))
    return _around(MOTION.first(known.n_joints), times * np.abs(q - known.centre).max(axis=0))


def _around(limits: MotionLimits, reach: Array) -> MotionLimits:
    return replace(limits, q_min=limits.centre - reach, q_max=limits.centre + reach)


def energies(n_joints: int, n_seeds: int) -> Iterator[Case]:
    """Figure `fig:LSE_energy`: energies along an unseen motion."""
    return generalization((n_joints,), n_seeds)


KNOWN_KINEMATICS = ('rigid_body', 'rigid_body_friction', 'semiparametric')
FRICTION = ('se', 'gip', 'lip', 'recursive', 'articulated', *KNOWN_KINEMATICS)
WITH_ENERGIES = ('lse', 'delan', 'lip', 'recursive', 'articulated')
EXPERIMENTS: dict[str, tuple[Form, Form]] = {
    'generalization': (
        Form(lambda: generalization((3, 4), 3), FAST, FitSettings()),
        Form(lambda: generalization((3, 4, 5, 6, 7), 50), BLACK_BOX, FitSettings(), 200_000),
    ),
    'six_joints': (
        Form(lambda: generalization((6,), 2), FAST, FitSettings(), 3000),
        Form(lambda: generalization((6,), 10), BLACK_BOX, FitSettings(), 6000),
    ),
    'data_efficiency': (
        Form(lambda: data_efficiency(4, (50, 150, 300), 2), FAST, FitSettings()),
        Form(lambda: data_efficiency(7, tuple(range(50, 501, 50)), 10), FAST, FitSettings()),
    ),
    'friction': (
        Form(lambda: by_measured(friction(4, 3, 4)), FRICTION, FitSettings(subset=150)),
        Form(lambda: by_measured(friction(6, 11, 11)), ('lse', *FRICTION), FitSettings()),
    ),
    'friction_truth': (
        Form(lambda: friction(4, 3, 4), FRICTION, FitSettings(subset=150)),
        Form(lambda: friction(6, 11, 11), ('lse', *FRICTION), FitSettings()),
    ),
    'energies': (
        Form(lambda: energies(3, 1), WITH_ENERGIES, FitSettings(subset=100)),
        Form(lambda: energies(6, 10), WITH_ENERGIES, FitSettings(), 6000),
    ),
}
"""By name: the short form, which takes minutes, and the full one, which takes hours or days."""
