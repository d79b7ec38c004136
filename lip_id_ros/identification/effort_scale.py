"""
Scales and signs of the joints' efforts, as of motor currents, and the unit of positions.

Since M(q) is symmetric and gravity has a potential, one set of links has to explain all joints:
links and a factor per joint are fitted in turns, with the joints placed anew. The unit shows in
half a usual motion: over small angles gravity is nearly a polynomial.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.placement_search import Calibration
from lip_id_ros.identification.statistics import triangular
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.progress import Progress, silent
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import kinetic_regressor, torque_regressor

SIGN_WIDTH = 0.05
"""Width of the smooth sign, as a share of each joint's root mean square velocity."""

INITIAL_NOISE = 0.05
LEAST_NOISE = 1e-4
ALTERNATIONS, NOISE_ROUNDS = 30, 2
SEARCHES = 8
CONVERGED, LEAST_DECREASE = 0.01, 0.02
"""Of scales from 1, and of residuals from one search to the next."""

WELL, EACH_WELL = 0.05, 0.2
"""
Geometric mean over joints of residuals, and the largest one, as shares of the efforts, below which
links explain them.
"""

ALIKE = 1.1
"""Ratio of the largest to the smallest scale up to which efforts have one scale."""

CLEARLY = 5.0
"""Torque of weight, in residuals, that links have on some joint only if there is weight."""


@dataclass(frozen=True, eq=False)
class EffortScale:
    """
    Efforts as links explain them best, in arrays (n,).

    Scales are efforts in units of torques that one arm has: negative where the sign is turned,
    with a geometric mean of 1. Friction is negative where it would drive a joint.
    """

    scale: Array
    residual: Array  # root mean squares as shares of each effort's deviation
    friction: Array  # at the usual speed, likewise
    gravity: Array  # root mean squares of the links' weight, likewise
    free_scale: Array  # that explain best with joints in the same places

    @property
    def bears_weight(self) -> bool:
        """Whether the weight of the links explains more than it could by chance."""
        return bool(np.any(self.gravity > CLEARLY * self.residual))

    @property
    def explains(self) -> bool:
        """Whether links and friction explain the effort of every joint well."""
        return self.mean_residual < WELL and bool(np.max(self.residual) < EACH_WELL)

    @property
    def is_odd(self) -> bool:
        """Whether friction drives a joint or other scales explain more: links may absorb both."""
        return bool(np.any(self.friction < 0.0)) or not alike(self.free_scale)

    def gain(self, other: EffortScale) -> float:
        """Return the product over joints of how many times smaller another's residuals are."""
        return float(np.prod(self.residual / other.residual))

    @property
    def mean_residual(self) -> float:
        """Geometric mean of the residuals over joints."""
        return float(np.exp(np.mean(np.log(self.residual))))


def as_recorded(dataset: Dataset, seed: int, progress: Progress = silent) -> EffortScale:
    """Explain efforts as they are, by links in places that are searched for; scales are 1."""
    chain, link_std = _placed(dataset, seed, progress)
    free = fit_scale(dataset, chain, link_std)
    return replace(fit_scale(dataset, chain, link_std, 1), free_scale=free.scale)


def alike(scale: Array) -> bool:
    """Return whether scales are those of one unit and sign."""
    return bool(np.min(scale) * ALIKE > np.max(scale) or np.max(scale) * ALIKE < np.min(scale))


def find_effort_scale(
    dataset: Dataset, recorded: EffortScale, seed: int, progress: Progress = silent
) -> EffortScale:
    """
    Find the scales of efforts, the placements of the joints and the links together.

    Where the friction of efforts as recorded would drive a joint, the sign is turned first.
    """
    scale = np.where(recorded.friction < 0.0, -1.0, 1.0)
    best = recorded
    for search in range(SEARCHES):
        scaled = replace(dataset, tau=dataset.tau / scale)
        found = fit_scale(scaled, *_placed(scaled, seed + search, progress))
        scale = scale * found.scale
        lower = found.mean_residual < (1.0 - LEAST_DECREASE) * best.mean_residual
        if found.mean_residual < best.mean_residual:
            best = replace(found, scale=scale)
        if np.allclose(np.abs(found.scale), 1.0, atol=CONVERGED) or (search and not lower):
            break
    return best


def _placed(dataset: Dataset, seed: int, progress: Progress) -> tuple[Chain, Array]:
    """Search for the places of the joints; return them with the prior deviations of the links."""
    fitter = ArmFitter(dataset)
    return ArmSearch(fitter).calibrated(seed, progress).placements.chain, fitter.link_std


def fit_scale(
    dataset: Dataset, chain: Chain, link_std: Array, alternations: int = ALTERNATIONS
) -> EffortScale:
    """
    Fit links, friction and scales with joints in given places.

    With 1 alternation scales are 1. `link_std` has the prior deviations of the links' parameters,
    shape (n, 11).
    """
    n, p = link_std.shape[0], link_std.size
    factors, k = _factors(dataset, chain, link_std)
    size = _positive(dataset.tau.std(axis=0)) * np.sqrt(dataset.n_samples)
    own = np.array([factor[k:, k:] for factor in factors])
    scale, noise = np.ones(n), INITIAL_NOISE * size
    for alternation in range(alternations + NOISE_ROUNDS):
        weighted = own.copy()
        weighted[:, :, :p] *= scale[:, None, None]
        weighted *= (np.sqrt(dataset.n_samples) / noise)[:, None, None]
        root = triangular(weighted.reshape(-1, p + 1), np.eye(p, p + 1))
        links = np.linalg.solve(root[:p, :p], root[:p, p])
        modelled, measured = own[:, :, :p] @ links, own[:, :, p]
        if NOISE_ROUNDS <= alternation < alternations + NOISE_ROUNDS - 1:
            scale = _unit(np.sum(modelled * measured, axis=1), np.sum(modelled**2, axis=1))
        residual = np.linalg.norm(measured - scale[:, None] * modelled, axis=1)
        noise = np.maximum(residual, LEAST_NOISE * size)
    friction = [
        np.linalg.solve(factor[:k, :k], factor[:k, -1] - factor[:k, k:-1] @ links * s)
        for factor, s in zip(factors, scale, strict=True)
    ]
    usual = np.array([value[0] + value[1] for value in friction])
    positive = 1.0 if _kinetic_energy(dataset, chain, links * link_std.ravel()) >= 0.0 else -1.0
    spread = size / np.sqrt(dataset.n_samples)
    still = np.zeros_like(dataset.q)
    weight = torque_regressor(chain, np.ascontiguousarray(dataset.q), still, still)
    gravity = scale * (weight @ (links * link_std.ravel()))
    scale = positive * scale
    return EffortScale(scale, noise / size, usual / spread, gravity.std(axis=0) / spread, scale)


def _factors(dataset: Dataset, chain: Chain, link_std: Array) -> tuple[list[Array], int]:
    """Return triangular factors [friction, links, effort], and the number of friction terms."""
    state = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
    links = torque_regressor(chain, *state) * link_std.ravel()
    speed = _positive(np.sqrt(np.mean(dataset.dq**2, axis=0)))
    ones = np.ones((dataset.n_samples, 1))
    factors = []
    for joint in range(dataset.n_joints):
        usual = dataset.dq[:, joint : joint + 1] / speed[joint]
        own = np.hstack([usual, np.tanh(usual / SIGN_WIDTH), ones])
        effort = dataset.tau[:, joint : joint + 1]
        ridge = np.eye(own.shape[1], own.shape[1] + links.shape[2] + 1) * LEAST_NOISE
        factors.append(triangular(np.hstack([own, links[:, joint], effort]), ridge))
    return factors, 3


def _kinetic_energy(dataset: Dataset, chain: Chain, links: Array) -> float:
    state = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq))
    return float(np.mean(kinetic_regressor(chain, *state) @ links))


def _unit(product: Array, power: Array) -> Array:
    """Return scales with a geometric mean of 1."""
    scale = product / np.maximum(power, 1e-300)
    scale = np.where(np.abs(scale) > 1e-6, scale, 1e-6)
    return np.asarray(scale / np.exp(np.mean(np.log(np.abs(scale)))))


def _positive(values: Array) -> Array:
    return np.where(values > 0.0, values, 1.0)


TURN = 2.0 * np.pi

MOST_REACH = 2.0
"""Range of every revolute joint that may be in revolutions."""

BADLY, HALF = 0.05, 0.5
"""
Residuals as shares of the torques, beyond which links explain them badly, and what may be left of
them where positions are taken for revolutions (geometric means over joints).
"""


def may_be_revolutions(dataset: Dataset) -> bool:
    """Return whether no revolute joint turns by more than two revolutions, if they are such."""
    revolute = ~is_prismatic(dataset.joint_types)
    return bool(revolute.any() and np.ptp(dataset.q[:, revolute], axis=0).max() <= MOST_REACH)


def from_revolutions(dataset: Dataset) -> Dataset:
    """Return a data set whose revolute joints were in revolutions, in rad."""
    factor = np.where(is_prismatic(dataset.joint_types), 1.0, TURN)
    q, dq, ddq = (factor * each for each in (dataset.q, dataset.dq, dataset.ddq))
    return replace(dataset, q=q, dq=dq, ddq=ddq)


def left_by_revolutions(
    search: ArmSearch, calibration: Calibration, seed: int, progress: Progress
) -> float | None:
    """Return the share of residuals that is left by revolutions; None where rad will do."""
    fitter = search.fitter
    as_rad = _mean(calibration.noise_std / fitter.torque_std)
    if as_rad < BADLY or not may_be_revolutions(fitter.dataset):
        return None
    other = search.of(fitter.of(from_revolutions(fitter.dataset)))
    left = _mean(other.calibrated(seed, progress).noise_std / fitter.torque_std) / as_rad
    return left if left < HALF else None


def _mean(values: Array) -> float:
    return float(np.exp(np.mean(np.log(values))))
