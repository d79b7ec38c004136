"""
The search for placements.

Two iterated local searches, until they agree. From axes at quarter turns, then joints of the best
minima are drawn anew (Lourenco, Martin and Stuetzle 2003).
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from lip_id_ros.arrays import Array
from lip_id_ros.identification.kinematic_calibration import (
    PlacementProblem,
    Placements,
    Samples,
)
from lip_id_ros.progress import Progress
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.near_frames import with_near_frames

LENGTH = 1.0 / 3.0
"""About how long links are [m]: for starts and priors, which need no more than that."""

COARSE = 0.05
"""Standard deviation of the residuals in the search, as a share of each torque's."""

FINEST = 1e-4
"""Smallest standard deviation of the residuals, likewise."""

RESOLUTION = 1e-5
"""
The same as a share of each torque's root mean square: nothing measures a large constant torque, as
the weight of a lift, more closely, and its squares would lose all others.
"""

SEARCHES = 2
STARTS, ROUNDS, MOST_BATCHES = 16, 8, 10
PATIENCE = 16
"""A search is at its end after so many descents that led to nothing lower."""

KEPT = 6
DISTINCT, SAME = 0.005, 0.01
"""Relative difference of costs of two minima, and of what counts as agreement of two searches."""

CANDIDATES, FINALISTS, REFINEMENTS = 6, 3, 2
"""Minima that are refined on few samples, and on all; rounds of noise of each."""

EVALUATIONS, MORE_EVALUATIONS = 40, 80
FINE = 1e-6
"""Share of the cost that a step of a refinement has to gain."""

ALIGNMENT_NOISE = 0.02
STAGE = 'kinematic calibration'

_CUBE = Rotation.create_group('O').as_matrix()


@dataclass(frozen=True, eq=False)
class Calibration:
    """Outcome of the search."""

    placements: Placements  # lowest minimum, refined on all samples
    candidates: tuple[Placements, ...]  # lowest minima, on the samples of the search
    noise_std: Array  # (n,), of residuals, at least `least_noise` [N m or N]
    agreed: bool  # whether both searches ended in the same minimum
    descents: int


def calibrate(samples: Samples, few: int, seed: int, progress: Progress) -> Calibration:
    """
    Find the placements of the joints of an arm, searching with `few` samples, evenly chosen.

    Raises FitError if the data are not finite in units of the noise.
    """
    coarse = coarse_noise(samples)
    some = few_of(samples, few)
    # Products this small gain nothing from more threads of their own.
    with threadpool_limits(1), ThreadPoolExecutor(SEARCHES) as pool:
        problem = PlacementProblem(some, coarse)
        searches = [_Search(problem, rng) for rng in np.random.default_rng(seed).spawn(SEARCHES)]
        agreed = _searched(searches, pool, progress)
        minima = _distinct([each for search in searches for each in search.minima])
    descents = sum(search.descents for search in searches)
    found = Calibration(minima[0], tuple(minima), coarse, agreed, descents)
    progress(STAGE, 1, 1)
    return refine(samples, few, found)


def refine(samples: Samples, few: int, found: Calibration) -> Calibration:
    """Descend from the lowest minima with residuals in units of those of the best."""
    floor, noise_std = least_noise(samples.tau), found.noise_std
    with threadpool_limits(1), ThreadPoolExecutor(SEARCHES) as pool:
        minima = list(found.candidates[:CANDIDATES])
        minima, noise_std = _refined(few_of(samples, few), minima, noise_std, floor, pool)
        # Few samples may order nearly equal minima wrongly.
        minima, noise_std = _refined(samples, minima[:FINALISTS], noise_std, floor, pool)
    return replace(found, placements=minima[0], candidates=tuple(minima), noise_std=noise_std)


def in_near_frames(samples: Samples, found: Calibration) -> Calibration:
    """
    Return the same arms, or their mirror images, in frames that are near each other.

    A fit depends on the frames that it starts from, of which torques contain nothing.
    """
    problem = PlacementProblem(samples, found.noise_std)
    chains = [with_near_frames(each.chain) for each in found.candidates]
    minima = tuple(problem.at(each.rotations, each.translations) for each in chains)
    return replace(found, placements=minima[0], candidates=minima)


def calibration_at(chain: Chain, samples: Samples) -> Calibration:
    """Return the calibration of an arm whose placements are given."""
    noise_std, floor = coarse_noise(samples), least_noise(samples.tau)
    for _ in range(REFINEMENTS):
        problem = PlacementProblem(samples, noise_std)
        placements = problem.at(chain.rotations, chain.translations)
        noise_std = np.maximum(problem.residual_rms(placements), floor)
    return Calibration(placements, (placements,), noise_std, agreed=True, descents=0)


def torque_size(tau: Array) -> Array:
    """Return the standard deviation of each torque, 1 where it does not change, shape (n,)."""
    torque = tau.std(axis=0)
    return np.where(torque > 0.0, torque, 1.0)


def least_noise(tau: Array) -> Array:
    """Return the smallest standard deviation that residuals count as, shape (n,) [N m or N]."""
    rms = np.sqrt(np.mean(np.square(tau), axis=0))
    return np.maximum(FINEST * torque_size(tau), RESOLUTION * rms)


def coarse_noise(samples: Samples) -> Array:
    """Return the residuals that the search is in units of, shape (n,) [N m or N]."""
    return np.maximum(COARSE * torque_size(samples.tau), least_noise(samples.tau))


def few_of(samples: Samples, few: int) -> Samples:
    """Return so many samples, evenly chosen."""
    return samples.select(np.unique(np.linspace(0, len(samples.tau) - 1, few).astype(np.intp)))


def quarter_turn_placements(n_joints: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """
    Draw axes that are parallel or at right angles, some way apart.

    (n, 3, 3) and (n, 3). A little noise keeps off saddle points.
    """
    twists = rng.choice([0.5 * np.pi, -0.5 * np.pi, 0.0], n_joints, p=[0.4, 0.4, 0.2])
    turns = 0.5 * np.pi * rng.integers(4, size=n_joints)
    angles = np.column_stack([turns, twists])
    rotations = Rotation.from_euler('ZX', angles).as_matrix()
    rotations[0] = _CUBE[rng.integers(len(_CUBE))]
    noise = Rotation.from_rotvec(ALIGNMENT_NOISE * rng.standard_normal((n_joints, 3)))
    translations = LENGTH / np.sqrt(3.0) * rng.standard_normal((n_joints, 3))
    translations[0] = 0.0
    return rotations @ noise.as_matrix(), translations


@dataclass(eq=False)
class _Search:
    """One iterated local search; its minima are distinct, lowest first."""

    problem: PlacementProblem
    rng: np.random.Generator
    minima: list[Placements] = field(default_factory=list)
    descents: int = 0
    idle: int = 0

    def run(self, rounds: int) -> None:
        for _ in range(rounds):
            self._descend(*self._start())

    @property
    def lowest(self) -> float:
        return self.minima[0].cost

    @property
    def is_idle(self) -> bool:
        return self.idle >= PATIENCE

    def _start(self) -> tuple[Array, Array]:
        n = self.problem.n_joints
        fresh = quarter_turn_placements(n, self.rng)
        if self.descents < STARTS:
            return fresh
        rank = min(int(self.rng.exponential(1.5)), len(self.minima) - 1)
        chain = self.minima[rank].chain
        first, count = self.rng.integers(n), self.rng.integers(1, 3)
        some = slice(first, first + count)
        rotations, translations = chain.rotations.copy(), chain.translations.copy()
        rotations[some], translations[some] = fresh[0][some], fresh[1][some]
        return rotations, translations

    def _descend(self, rotations: Array, translations: Array) -> None:
        found = self.problem.descend(rotations, translations, EVALUATIONS)
        lower = not self.minima or found.cost < (1.0 - DISTINCT) * self.lowest
        self.idle = 0 if lower else self.idle + 1
        self.minima = _distinct([*self.minima, found])[:KEPT]
        self.descents += 1


def _searched(searches: list[_Search], pool: ThreadPoolExecutor, progress: Progress) -> bool:
    """Go on until the searches agree; return whether they do."""

    def run(rounds: int) -> None:
        list(pool.map(lambda search: search.run(rounds), searches))

    progress(STAGE, 0, MOST_BATCHES)
    run(STARTS)
    for batch in range(MOST_BATCHES):
        run(ROUNDS)
        progress(STAGE, batch + 1, MOST_BATCHES)
        lowest = [search.lowest for search in searches]
        agree = max(lowest) <= (1.0 + SAME) * min(lowest)
        if agree and all(search.is_idle for search in searches):
            return True
    return agree


def _distinct(found: list[Placements]) -> list[Placements]:
    """Return the lowest of each group of alike costs, lowest first."""
    chosen: list[Placements] = []
    for each in sorted(found, key=lambda placements: placements.cost):
        if not chosen or each.cost > (1.0 + DISTINCT) * chosen[-1].cost:
            chosen.append(each)
    return chosen


def _refined(
    samples: Samples,
    minima: list[Placements],
    noise_std: Array,
    floor: Array,
    pool: ThreadPoolExecutor,
) -> tuple[list[Placements], Array]:
    """Descend again, with residuals in units of those of the best, best first."""
    for _ in range(REFINEMENTS):
        problem = PlacementProblem(samples, noise_std)
        chain = minima[0].chain
        residual = problem.residual_rms(problem.at(chain.rotations, chain.translations))
        noise_std = np.maximum(residual, floor)
        minima = _descended(PlacementProblem(samples, noise_std), minima, pool)
    return minima, noise_std


def _descended(
    problem: PlacementProblem, minima: list[Placements], pool: ThreadPoolExecutor
) -> list[Placements]:
    def descend(each: Placements) -> Placements:
        chain = each.chain
        return problem.descend(chain.rotations, chain.translations, MORE_EVALUATIONS, FINE)

    return sorted(pool.map(descend, minima), key=lambda each: each.cost)
