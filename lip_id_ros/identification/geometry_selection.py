"""
Which twists are quarter turns and which axes meet, by backward elimination.

All near simple geometry is imposed; what likelihood and left-out blocks speak against goes one by
one, judged beside the others, so that what one gains does not pay for another.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, MOST_SAMPLES
from lip_id_ros.identification.posterior import known_of, left_out_of, posterior
from lip_id_ros.identification.simple_geometry import candidates, Geometry, together
from lip_id_ros.identification.solution import left_out_at_present
from lip_id_ros.identification.statistics import LeftOut
from lip_id_ros.linear_algebra import normal_solution

TWIST_DEVIATIONS, LENGTH_DEVIATIONS = 3.0, 2.5
"""
Standard deviations from simple geometry beyond which the likelihood speaks against a twist and
against a length: few arms have axes that are askew, and many have axes that do not meet. Their
root mean squares where axes are at right angles, or meet, are 1.0 and 1.2.
"""

LEAST_ERRORS = 2.0
"""Increase of left-out errors, in its standard errors, for which geometry is released anyway."""

MOST_TRIALS, SELECTION_SAMPLES = 12, 5000
ROUNDS = (20,)
"""Evaluations of the descent of a trial."""


@dataclass(frozen=True, eq=False)
class Trial:
    """A fit with simple geometry."""

    fit: ArmFit
    imposed: tuple[Geometry, ...]  # one twist or length each
    left_out: LeftOut

    def without(self, k: int) -> tuple[Geometry, ...]:
        """Return what is imposed but for one."""
        return self.imposed[:k] + self.imposed[k + 1 :]


def select_geometry(fitter: ArmFitter, fit: ArmFit) -> ArmFit:
    """Set twists of a free fit to quarter turns and lengths to zero, as many as the data bear."""
    thinned = fitter.thinned(SELECTION_SAMPLES)
    _, _, solution, total = posterior(thinned, fit)
    offers = tuple(
        geometry for _, geometry in candidates(solution.chain, solution.covariance_root)
    )
    left_out = left_out_at_present(total, known_of(thinned, fit))
    selection = GeometrySelection(thinned, Trial(fit, (), left_out))
    # the left-out errors of a trial are those of its minimum, which its descent has not reached
    return fitter.converged(fitter.some(MOST_SAMPLES), selection.selected(offers))


class GeometrySelection:
    """Backward elimination, with at most `MOST_TRIALS` fits."""

    def __init__(self, fitter: ArmFitter, free: Trial) -> None:
        self._fitter, self._free, self._left = fitter, free, MOST_TRIALS

    def selected(self, offers: tuple[Geometry, ...]) -> ArmFit:
        """Return the fit with all of the offers but those that were released."""
        trial: Trial | None = self._tried(self._free.fit, offers)
        while trial is not None:
            last, trial = trial, self._released(trial)
        return last.fit

    def deviations(self, trial: Trial) -> Array:
        """
        Return how far each twist or length would be from where it is imposed beside the others.

        By the increase of the likelihood along one Gauss-Newton step (Rao's score test), with
        noise and inflation of the free fit, in standard deviations.
        """
        free = self._free.left_out
        # root mean squares of residuals lack what the parameters have taken of the noise
        noise = replace(trial.fit.noise, std=free.unbiased_std)
        gains = _Gains(self._fitter, replace(trial.fit, noise=noise))
        now = gains.within(trial.fit.geometry)
        n = self._fitter.dataset.n_joints
        rest = [together(list(trial.without(k)), n) for k in range(len(trial.imposed))]
        more = np.array([gains.within(geometry) - now for geometry in rest])
        return np.asarray(np.sqrt(2.0 * np.maximum(more, 0.0) / free.inflation))

    def _tried(self, fit: ArmFit, imposed: tuple[Geometry, ...]) -> Trial:
        self._left -= 1
        fitter = self._fitter
        geometry = together(list(imposed), fitter.dataset.n_joints)
        some = fitter.some(MOST_SAMPLES)
        tried = fitter.refined(some, fitter.with_geometry(fit, geometry), ROUNDS)
        return Trial(tried, imposed, left_out_of(fitter, tried))

    def _released(self, trial: Trial) -> Trial | None:
        """Return the trial without what the data speak against, None where there is no such."""
        vetoed = _worse(trial.left_out, self._free.left_out)
        for k, doubtful in self._by_doubt(trial):
            if self._left == 0 or not (doubtful or vetoed):
                break
            without = self._tried(trial.fit, trial.without(k))
            if vetoed or _score(without.left_out) < _score(trial.left_out):
                return without
        return None

    def _by_doubt(self, trial: Trial) -> Iterator[tuple[int, bool]]:
        """Yield what is imposed, the most doubtful first, and whether likelihood doubts it."""
        shares = self.deviations(trial) / [_most_deviations(each) for each in trial.imposed]
        for k in np.argsort(-shares):
            yield int(k), bool(shares[k] > 1.0)


class _Gains:
    """Log likelihood that one Gauss-Newton step from a fit gains within a geometry."""

    def __init__(self, fitter: ArmFitter, fit: ArmFit) -> None:
        n = fitter.dataset.n_joints
        problem = fitter.problem(fitter.dataset, replace(fit, geometry=Geometry.free(n)))
        self._chain = fit.chain
        self._hessian, self._slope = problem.normal_equations(problem.evaluated(fit.state))

    def within(self, geometry: Geometry) -> float:
        """Return the gain of a step that keeps a geometry."""
        placements = geometry.projector(self._chain)
        allowed = np.eye(self._slope.size)
        allowed[: len(placements), : len(placements)] = placements
        slope = allowed @ self._slope
        hessian = allowed @ self._hessian @ allowed + np.eye(slope.size) - allowed
        return float(0.5 * slope @ normal_solution(hessian, slope))


def _most_deviations(imposed: Geometry) -> float:
    return LENGTH_DEVIATIONS if imposed.meets.any() else TWIST_DEVIATIONS


def _worse(left_out: LeftOut, free: LeftOut) -> bool:
    """Return whether left-out blocks are predicted worse than without geometry for sure."""
    changes = (left_out.block_squares - free.block_squares) / free.mean_squares
    each = changes.sum(axis=1)
    error = float(each.std(ddof=1) / np.sqrt(each.size)) if each.size > 1 else 0.0
    return 2.0 * (_score(left_out) - _score(free)) > LEAST_ERRORS * error


def _score(left_out: LeftOut) -> float:
    return float(0.5 * np.log(left_out.mean_squares).sum())
