"""
The default fit beside fits with fewer terms, on simulated arms of kinds that are hard.

Drives have memory, stick, droop or pull by soft cables; recordings are short, periodic or coarse.
Prints a line for each kind of arm, and one for all: geometric means over joints and seeds of the
errors of another motion's measured torques [%]: of the default (`fit.terms: processes`), without
processes (`named`), and with links and friction alone (`friction`).

"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import time

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks._results import line, Results, Row, short
from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.identification import fit
from lip_id_ros.identification.identify import OFFERS
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import link_parameters, scale_of
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.settings import FitSettings, RecordingSettings
from lip_id_ros.simulation.trajectories import MotionLimits, SinusoidTrajectory

R, P = 'revolute', 'prismatic'
TYPES, TENDON_TYPES = (R, R, R, R), (R, R, P)
UNSEEN_S, UNSEEN_PERIOD = 30.0, 1.37
"""How long an unseen motion is, and its period in those of the seen one."""


@dataclass(frozen=True)
class Family:
    """
    Arms of a kind, and how they are recorded.

    The motion repeats after `period_s`. `stribeck` is the share of the usual speed at which the
    added friction near rest has fallen by 1/e. Dry friction turns within a `displacement` [rad or
    m]. `stiffness` is that of cables between motors, which have the encoders, and links [N m/rad].
    `mass`: of the links, in those of an arm of industry. `droop`: what the efforts of the last two
    joints lack at the usual speed. `cogging` repeats eleven times a turn. `step`: of the efforts.
    Torques are in standard deviations of those of the links.

    """

    joint_types: tuple[str, ...] = TYPES
    period_s: float = 10.0
    seconds: float = 30.0
    rate_hz: float = 200.0
    recordings: int = 1
    fastest_hz: float = 0.6
    viscous: float = 0.1
    coulomb: float = 0.15
    stiction: float = 0.05
    stribeck: float = 0.1
    displacement: float = 0.0
    spring: float = 0.0
    stiffness: float = np.inf
    mass: float = 1.0
    droop: float = 0.0
    cogging: float = 0.0
    noise: float = 0.02
    step: float = 0.0
    rests: bool = False


FAMILIES: Mapping[str, Family] = {
    'tendons': Family(
        TENDON_TYPES, 6.5, 30.0, 100.0, stiction=0.1, spring=0.3, stiffness=200.0, mass=0.3
    ),
    'soft tendons': Family(
        TENDON_TYPES, 6.5, 30.0, 100.0, stiction=0.1, spring=0.3, stiffness=200.0, mass=0.8
    ),
    'two short paths': Family(
        period_s=10.0, seconds=10.0, recordings=2, displacement=3e-3, coulomb=0.3, rests=True
    ),
    'small, coarse currents': Family(
        rate_hz=25.0, step=0.1, coulomb=0.3, displacement=0.01, cogging=0.1, noise=0.05
    ),
    'stiction': Family(coulomb=0.8, stiction=0.6, noise=0.1, displacement=0.01, fastest_hz=0.3),
    'falls with speed': Family(droop=0.4, displacement=1e-3, rests=True),
}
"""By the names that the page has for them."""

SIZES = (0.4, 0.5, 0.45, 0.15)
"""Of the links [m]."""
MASSES = (15.0, 12.0, 7.0, 3.0)
"""[kg]"""
TWISTS = (0.0, 90.0, 0.0, 90.0)
"""Of the axes [degrees]."""
REACH = (1.5, 0.8, 0.8, 1.5)
"""Largest positions [rad]; of a slide a fifth of it [m]."""
POSITION_STEP = 2.0 * np.pi / 2**15
"""Of encoders [rad], a tenth of it of slides [m]."""


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, and print the lines of the table."""
    parser = argparse.ArgumentParser(prog='benchmarks families', description=__doc__)
    parser.add_argument('--results', type=Path, default=Path('families.json'))
    parser.add_argument('--families', nargs='+', choices=FAMILIES, default=list(FAMILIES))
    parser.add_argument('--seeds', nargs='+', type=int, default=list(range(3)))
    options = parser.parse_args(arguments)
    results, every = Results(options.results), []
    for name in options.families:
        rows = {
            terms: [
                results.row(f'{name} | {seed} | {terms}', partial(measured, name, seed, terms))
                for seed in options.seeds
            ]
            for terms in OFFERS
        }
        every.append(logs_of(rows))
        print(row_of(name, every[-1]), flush=True)
    print(row_of('all', np.concatenate(every, axis=1)))
    return 0


def measured(name: str, seed: int, terms: str) -> Row:
    """Fit an arm, and return its errors on another motion [%], and what was selected."""
    train, test = FamilyArm(FAMILIES[name], seed).recorded(seed)
    started = time.process_time()
    model = fit(train, FitSettings(terms=terms))
    cpu_s = time.process_time() - started
    tau = model.predict(test.q, test.dq, test.ddq, test.t).tau
    return {
        'nmse': nmse_percent(tau, test.tau).tolist(),
        'cpu_s': cpu_s,
        'friction': model.summary['friction'],
        'remainder': model.summary['remainder'],
    }


def logs_of(rows: Mapping[str, Sequence[Row]]) -> Array:
    """Return the logarithms of errors of each kind of fit, shape (kinds, joints of all seeds)."""
    return np.log([np.concatenate([row['nmse'] for row in some]) for some in rows.values()])


def row_of(name: str, logs: Array) -> str:
    """Return geometric means of errors, the default first, and its ratio to the best of all."""
    means = np.exp(logs.mean(axis=1))
    return line(name, *map(short, means), f'{means[0] / means.min():.2f}')


class FamilyArm:
    """One arm of a family, whose links, springs and drives are drawn by a seed."""

    def __init__(self, family: Family, seed: int) -> None:
        self.family = family
        rng = np.random.default_rng(seed)
        self._n = n = len(family.joint_types)
        self._unseen_s = UNSEEN_PERIOD * family.period_s
        self._slides = np.asarray(is_prismatic(family.joint_types))
        self._chain = _chain(rng, self._slides)
        numbers = 0.4 * rng.standard_normal((n, LINK_PARAMETERS))
        links = [
            link_parameters(row[None], scale_of(family.mass * mass, size / 2.0))
            for row, mass, size in zip(numbers, MASSES, SIZES, strict=False)
        ]
        self._links = np.concatenate(links).ravel()
        reach = np.where(self._slides, 0.2, 1.0) * np.array(REACH[:n])
        self._limits = MotionLimits(-reach, reach, 2.0 * reach, 6.0 * reach)
        usual = self._motion(rng, self._unseen_s).sample(np.linspace(0.0, UNSEEN_S, 300))
        self._size, self._speed = self._rigid(*usual).std(axis=0), usual[1].std(axis=0)
        self._shares = rng.uniform(0.5, 1.5, (6, n))
        self._shares[5, : n - 2] = 0.0
        self._phase = rng.uniform(0.0, 2.0 * np.pi, n)

    def recorded(self, seed: int) -> tuple[Dataset, Dataset]:
        """Return what is learned from, and another motion of half a minute."""
        rng = np.random.default_rng([seed, 1])
        family = self.family
        seen = [
            self._recording(family.seconds, self._motion(rng, family.period_s), rng)
            for _ in range(family.recordings)
        ]
        unseen = self._recording(UNSEEN_S, self._motion(rng, self._unseen_s), rng)
        return concatenate(seen), unseen

    def _motion(self, rng: np.random.Generator, period_s: float) -> SinusoidTrajectory:
        count = round(self.family.fastest_hz * period_s)
        return SinusoidTrajectory.random(self._limits, rng, count, 1.0 / period_s)

    def _recording(
        self, seconds: float, motion: SinusoidTrajectory, rng: np.random.Generator
    ) -> Dataset:
        """Record positions of the motors and efforts, and prepare them as any recording."""
        family = self.family
        t = np.arange(round(seconds * family.rate_hz)) / family.rate_hz
        q, dq, ddq = _resting(motion, t) if family.rests else motion.sample(t)
        load = self._rigid(q, dq, ddq) + self._springs(q)
        q = q + np.where(self._slides, 0.0, load / family.stiffness)
        tau = load + self._drives(q, dq)
        tau += family.noise * self._size * rng.standard_normal(tau.shape)
        step = np.maximum(family.step * self._size, 1e-9)
        encoder = POSITION_STEP * np.where(self._slides, 0.1, 1.0)
        samples = JointSamples(
            t=t,
            position=encoder * np.round(q / encoder),
            velocity=np.full_like(q, np.nan),
            effort=step * np.round(tau / step),
            joint_names=tuple(f'joint_{k + 1}' for k in range(self._n)),
        )
        return preprocess(samples, recording=RecordingSettings(joint_types=family.joint_types))

    def _rigid(self, q: Array, dq: Array, ddq: Array) -> Array:
        state = (np.ascontiguousarray(each) for each in (q, dq, ddq))
        return np.asarray(torque_regressor(self._chain, *state) @ self._links)

    def _springs(self, q: Array) -> Array:
        share = self._shares[0] / np.where(self._slides, 0.2, 1.0)
        return np.asarray(self.family.spring * self._size * share * q)

    def _drives(self, q: Array, dq: Array) -> Array:
        """Return friction, and what else efforts contain, shape (N, n)."""
        family, rate = self.family, dq / self._speed
        sign = np.tanh(rate / 0.02)
        if family.displacement:
            sign = remembered(q, sign[0], family.displacement * np.where(self._slides, 0.2, 1.0))
        near = np.exp(-np.square(rate / family.stribeck))
        dry = family.coulomb * self._shares[1] + family.stiction * self._shares[2] * near
        droop = -family.droop * self._shares[5] * np.tanh(rate) * np.abs(rate)
        cogging = family.cogging * self._shares[3] * np.sin(11.0 * q + self._phase)
        viscous = family.viscous * self._shares[4] * rate
        return np.asarray(self._size * (viscous + dry * sign + droop + cogging))


def _chain(rng: np.random.Generator, slides: BoolArray) -> Chain:
    """Draw placements: axes at right angles, as those of most arms."""
    n = len(slides)
    twists = Rotation.from_euler('x', np.array(TWISTS[:n])[:, None], degrees=True).as_matrix()
    turns = Rotation.from_euler('z', rng.choice((0.0, 90.0, -90.0), (n, 1)), degrees=True)
    lengths = np.array([0.0, *SIZES[: n - 1]])[:, None] * rng.uniform(0.7, 1.3, (n, 1))
    along = np.array([[0, 0, 1], [1, 0, 0], [1, 0, 0], [0, 1, 0]])
    return Chain(
        np.ascontiguousarray(twists @ turns.as_matrix()),
        np.ascontiguousarray(lengths * along[:n]),
        slides,
        np.array([0.0, 0.0, -9.81]),
    )


def _resting(motion: SinusoidTrajectory, t: Array) -> tuple[Array, Array, Array]:
    """Follow a motion with stops: every 2.5 s the arm has stood for a quarter of that time."""
    length, share = 2.5, 0.75
    number, part = np.divmod(t / length, 1.0)
    s = np.minimum(part / share, 1.0)
    along = 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5
    rate = (30.0 * s**2 - 60.0 * s**3 + 30.0 * s**4) / share
    change = (60.0 * s - 180.0 * s**2 + 120.0 * s**3) / (share**2 * length)
    q, dq, ddq = motion.sample(length * (number + along))
    rate, change = rate[:, None], change[:, None]
    return q, dq * rate, ddq * rate**2 + dq * change


def remembered(q: Array, first: Array, displacement: Array) -> Array:
    """Return the states of dry friction that turns within a displacement, shape (N, n)."""
    out, step = np.empty_like(q), np.diff(q, axis=0)
    out[0] = first
    for k, each in enumerate(step):
        sign = np.sign(each)
        out[k + 1] = sign + (out[k] - sign) * np.exp(-np.abs(each) / displacement)
    return out
