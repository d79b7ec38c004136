"""
The search for placements, with springs where these explain torques (maths.md, section 10).

A strong spring looks like gravity of a link in a wrong place, so that the search would end there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.friction.conservative_terms import spring
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.identification.arm_fit import ArmFitter, SEARCH_SAMPLES, START_SAMPLES
from lip_id_ros.identification.friction_candidates import memory_terms, named_candidates, rise_time
from lip_id_ros.identification.friction_selection import Offer
from lip_id_ros.identification.kinematic_calibration import (
    Placements,
    placements_residual,
    Samples,
)
from lip_id_ros.identification.placement_search import (
    calibrate,
    Calibration,
    calibration_at,
    refine,
)
from lip_id_ros.progress import Progress
from lip_id_ros.rigid_body import Chain

FEW_SAMPLES = 100
"""Of the search, before its minima are refined."""

CHUNK = 5000
"""Samples whose features are in memory together."""

SIGN_WIDTH = 0.05
"""Width of the smooth sign of the search, as a share of each joint's root mean square velocity."""

REST_RATIO = 8.0
"""
Standard deviation at rest in that of motion while placements are searched for; below
`SIGN_WIDTH` a joint is near rest.
"""

PROBE = 0.5
"""
Decrease of the logarithm of a joint's residual, by a descent with springs from the minima of a
search without them, that is worth another search.
"""

LEAST_RESIDUAL = 0.02
"""The same of that residual, as a share of the torque's deviation; places are right below."""

LEAST_GAIN = 0.1
"""Least decrease of the mean logarithm of the joints' left-out residuals by the other search."""


class ArmSearch:
    """
    Searches for placements, or takes those of the fitter's robot description.

    `terms` are linear and beside viscous and Coulomb friction and offsets; `rise_time` is that of
    the torques' low-pass [s], 0 for signs of constant width.
    """

    def __init__(
        self, fitter: ArmFitter, terms: tuple[DriveTerm, ...] = (), rise_time: float = 0.0
    ) -> None:
        self.fitter, self.terms, self.rise_time = fitter, terms, rise_time

    def of(self, fitter: ArmFitter) -> ArmSearch:
        """Return a search in other samples, with the same terms."""
        return ArmSearch(fitter, self.terms, self.rise_time)

    def with_springs(self) -> ArmSearch:
        """Return a search with a spring at every joint."""
        drives = map(Drive.of_joint, range(self.fitter.dataset.n_joints))
        springs = tuple(DriveTerm(drive, spring()) for drive in drives)
        return ArmSearch(self.fitter, springs, self.rise_time)

    def with_memory(self) -> ArmSearch:
        """Return a search with friction that remembers at every joint, of all displacements."""
        widths = enumerate(self._widths.tolist())
        memories = [term for joint, width in widths for term in memory_terms(joint, width)]
        return ArmSearch(self.fitter, (*self.terms, *memories), self.rise_time)

    def calibrated(self, seed: int, progress: Progress) -> Calibration:
        """
        Find the placements.

        Raises FitError if the data are not finite in units of the noise.
        """
        samples, described = self.search_samples(), self.fitter.prior.chain
        if described is not None:
            return calibration_at(described, samples)
        return calibrate(samples, FEW_SAMPLES, seed, progress)

    def recalibrated(self, calibration: Calibration) -> Calibration:
        """Refine placements that were found in other samples, or with other terms."""
        samples, described = self.search_samples(), self.fitter.prior.chain
        if described is not None:
            return calibration_at(described, samples)
        return refine(samples, FEW_SAMPLES, calibration)

    def log_residuals(self, chain: Chain) -> Array:
        """Return the logarithms of the joints' residuals with the joints in given places, (n,)."""
        return np.asarray(np.log(calibration_at(chain, self._samples(START_SAMPLES)).noise_std))

    def residual(self, placements: Placements) -> Array:
        """Return the residuals of a calibration at all samples, shape (N, n) [N m or N]."""
        dataset = self.fitter.dataset
        parts = np.array_split(np.arange(dataset.n_samples), -(-dataset.n_samples // CHUNK))
        return np.concatenate(
            [placements_residual(placements, self.samples(dataset.select(rows))) for rows in parts]
        )

    def search_samples(self) -> Samples:
        """Return the samples of the search."""
        return self._samples(SEARCH_SAMPLES)

    def _samples(self, count: int) -> Samples:
        return self.samples(self.fitter.some(count))

    @property
    def _widths(self) -> Array:
        speed = np.sqrt(np.mean(self.fitter.dataset.dq**2, axis=0))
        return np.asarray(SIGN_WIDTH * np.where(speed > 0.0, speed, 1.0))

    def samples(self, dataset: Dataset) -> Samples:
        """Return samples with the friction terms of the search."""
        widths = self._widths
        plain = plain_friction(dataset.n_joints, widths)
        basis = replace(plain, terms=plain.terms + self.terms, rise_time=self.rise_time)
        noise = TorqueNoise(np.ones_like(widths), np.full_like(widths, REST_RATIO), widths)
        return self.fitter.samples(dataset, basis, None, noise.weights(dataset.dq))


def find_placements(
    fitter: ArmFitter, seed: int, progress: Progress
) -> tuple[ArmSearch, Calibration]:
    """
    Find the placements, with springs if these predict left-out blocks better.

    Raises FitError.
    """
    search = ArmSearch(fitter, rise_time=rise_time(fitter.dataset))
    found = search.calibrated(seed, progress)
    is_large = found.noise_std > LEAST_RESIDUAL * fitter.torque_std
    if fitter.is_described or not is_large.any():
        return search, found
    sprung = search.with_springs()
    probed = sprung.recalibrated(found)
    if not (is_large & (np.log(found.noise_std / probed.noise_std) > PROBE)).any():
        return search, found
    other = sprung.calibrated(seed, progress)
    gain = log_left_out(fitter, found) - log_left_out(fitter, other)
    return (sprung, other) if gain >= LEAST_GAIN else (search, found)


def log_left_out(fitter: ArmFitter, found: Calibration) -> float:
    """Return the mean logarithm of the joints' left-out residuals, with selected friction."""
    # curves over the position and springs with a lever would make up for wrong placements
    offer = Offer(named_candidates, levers=False)
    selected = fitter.selected(found.placements.chain, offer)
    return float(np.log(selected.noise.std).mean())
