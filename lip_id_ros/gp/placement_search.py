"""The search for the placements of an arm's joints: many starts, then more of the data."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
import os

import numpy as np
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.gp.placements import descend, PlacementProblem
from lip_id_ros.kernels import RigidLinks
from lip_id_ros.progress import Progress
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

STANDARD_GRAVITY = 9.80665
LENGTH = 1.0 / 3.0
"""About how long links are [m]: for prior deviations and starts, which need no more than that."""

COARSE = 0.05
"""Deviation of the residuals in the first descents, as a share of each torque's."""

FINEST = 1e-4
"""Smallest deviation of the residuals, likewise."""

BATCH, FEWEST_BATCHES, MOST_BATCHES = 4, 4, 12
SAME = 1.01
"""Ratio of costs below which two descents have ended in the same place."""

CANDIDATES = 3
REFINEMENTS = 2
FIRST_EVALUATIONS, MORE_EVALUATIONS = 40, 30
STAGE = 'placements of joints'


@dataclass(frozen=True, eq=False)
class Samples:
    """
    Torques to be explained by links and friction.

    Attributes
    ----------
    dataset : Dataset
    friction : array, shape (N, n, k)
        Features of friction in units of their prior deviations; k may be 0.

    """

    dataset: Dataset
    friction: Array

    def select(self, rows: IndexArray) -> Samples:
        """Return some of the samples."""
        return Samples(self.dataset.select(rows), self.friction[rows])


@dataclass(frozen=True, eq=False)
class Found:
    """
    Links found in data.

    Attributes
    ----------
    links : RigidLinks
    left_over : array, shape (n,)
        Root mean squares of what links and friction leave of the torques [N m or N]; at least
        `FINEST` of each.

    """

    links: RigidLinks
    left_over: Array


def find_links(samples: Samples, few: int, seed: int, progress: Progress) -> Found:
    """
    Find where the joints of an arm are.

    Parameters
    ----------
    samples : Samples
    few : int
        Of so many samples, evenly chosen, the first descents make do.
    seed : int
        Of the starts.
    progress : callable

    """
    search = _Search(samples)
    rows = np.unique(np.linspace(0, len(samples.friction) - 1, few).astype(np.intp))
    some = samples.select(rows)
    # Products this small gain nothing from more threads of their own.
    with threadpool_limits(1):
        places = search.distinct_places(some, seed, progress)
        places = search.refined(some, places)
        (place, *_) = search.refined(samples, places[:1])
        search.measure(samples, place)
    progress(STAGE, 1, 1)
    return Found(search.problem(samples).links(place), search.scale)


class _Search:
    """Descents with residuals in units of what the best one so far has left over."""

    def __init__(self, samples: Samples) -> None:
        dataset = samples.dataset
        torque = dataset.tau.std(axis=0)
        self._torque = np.where(torque > 0.0, torque, 1.0)
        down = 0.0 if dataset.gravity_compensated else -STANDARD_GRAVITY
        self._gravity = np.array([0.0, 0.0, down])
        self._deviations = prior_deviations(dataset, STANDARD_GRAVITY)
        self.scale = COARSE * self._torque

    def problem(self, samples: Samples) -> PlacementProblem:
        return PlacementProblem(
            samples.dataset, samples.friction, self._deviations, self.scale, self._gravity
        )

    def distinct_places(self, samples: Samples, seed: int, progress: Progress) -> list[Array]:
        """Descend from random placements, until the lowest place has been reached twice."""
        problem, rng = self.problem(samples), np.random.default_rng(seed)
        follow = partial(descend, problem, evaluations=FIRST_EVALUATIONS)
        found: list[tuple[float, Array]] = []
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for batch in range(MOST_BATCHES):
                progress(STAGE, batch, MOST_BATCHES)
                starts = [random_placements(problem.n_joints, rng) for _ in range(BATCH)]
                found.extend(pool.map(follow, starts))
                costs = np.array([cost for cost, _ in found])
                agreed = np.count_nonzero(costs <= SAME * costs.min()) > 1
                if agreed and batch + 1 >= FEWEST_BATCHES:
                    break
        return [found[index][1] for index in _distinct(costs)]

    def refined(self, samples: Samples, places: Sequence[Array]) -> list[Array]:
        """Descend again, with residuals in units of what is left over, best first."""
        for _ in range(REFINEMENTS):
            self.measure(samples, places[0])
            problem = self.problem(samples)
            found = [descend(problem, place, MORE_EVALUATIONS) for place in places]
            places = [place for _, place in sorted(found, key=lambda each: each[0])]
        return list(places)

    def measure(self, samples: Samples, place: Array) -> None:
        """Take for the residuals' deviations what is left over at a place."""
        left_over = self.problem(samples).fit(place).left_over * self.scale
        self.scale = np.maximum(np.sqrt(np.mean(left_over**2, axis=0)), FINEST * self._torque)


def prior_deviations(dataset: Dataset, gravity: float) -> Array:
    """Return deviations of the parameters, (n, 11), that make torques of the measured size."""
    acceleration = gravity + LENGTH * np.sqrt(np.mean(dataset.ddq**2))
    mass = np.sqrt(np.mean(dataset.tau**2)) / (LENGTH * acceleration)
    moment, inertia = mass * LENGTH, mass * LENGTH**2
    return np.tile([mass, *[moment] * 3, *[inertia] * 7], (dataset.n_joints, 1))


def random_placements(n_joints: int, rng: np.random.Generator) -> Array:
    """Return axes in all directions, some way apart, shape (6 n,)."""
    vector = np.zeros((n_joints, DIRECTIONS))
    vector[:, :3] = Rotation.random(n_joints, random_state=rng).as_rotvec()
    vector[1:, 3:] = LENGTH / np.sqrt(3.0) * rng.standard_normal((n_joints - 1, 3))
    return vector.ravel()


def _distinct(costs: Array) -> list[int]:
    """Return the lowest of each group of alike costs, lowest first."""
    chosen: list[int] = []
    for index in np.argsort(costs):
        if all(costs[index] > SAME * costs[other] for other in chosen):
            chosen.append(int(index))
    return chosen[:CANDIDATES]
