"""Which twists are quarter turns and which axes meet, elected by prediction of left-out blocks."""

from __future__ import annotations

import numpy as np

from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, MOST_SAMPLES
from lip_id_ros.identification.laplace import left_out_of, LeftOut, posterior
from lip_id_ros.identification.simple_geometry import candidates, Geometry, together

MOST_LOSS = 0.01
"""Increase of the logarithm of left-out errors per joint that simple geometry may cost."""

MOST_TRIALS, ELECTION_SAMPLES = 8, 5000
ROUNDS = (20,)
"""Evaluations of the descent of a trial."""


def elect_geometry(fitter: ArmFitter, fit: ArmFit) -> ArmFit:
    """
    Set twists to quarter turns and lengths to zero, as many as prediction bears.

    All that lie within a few standard deviations of simple geometry are tried together; where that
    predicts worse, the nearer half of them, and then the other half beside it, and so on.

    Parameters
    ----------
    fitter : ArmFitter
    fit : ArmFit
        Without a geometry.

    """
    thinned = fitter.thinned(ELECTION_SAMPLES)
    _, arm, left_out = posterior(thinned, fit)
    offers = [geometry for _, geometry in candidates(arm.chain, arm.covariance_root)]
    election = _Election(thinned, _score(left_out) + MOST_LOSS * fitter.dataset.n_joints)
    # the left-out errors of a trial are those of its minimum, which its descent has not reached
    return fitter.converged(fitter.some(MOST_SAMPLES), election.elected(fit, offers))


class _Election:
    """Trials of geometries, at most `MOST_TRIALS`."""

    def __init__(self, fitter: ArmFitter, most: float) -> None:
        self._fitter, self._most, self._left = fitter, most, MOST_TRIALS

    def elected(self, fit: ArmFit, offers: list[Geometry]) -> ArmFit:
        """Return the fit with as many of the offers as prediction bears."""
        if not offers or self._left == 0:
            return fit
        self._left -= 1
        fitter = self._fitter
        geometry = together([fit.geometry, *offers], fitter.dataset.n_joints)
        some = fitter.some(MOST_SAMPLES)
        tried = fitter.refined(some, fitter.with_geometry(fit, geometry), ROUNDS)
        if _score(left_out_of(fitter, tried)) <= self._most:
            return tried
        half = (len(offers) + 1) // 2
        if half == len(offers):
            return fit
        return self.elected(self.elected(fit, offers[:half]), offers[half:])


def _score(left_out: LeftOut) -> float:
    return float(0.5 * np.log(left_out.mean_squares).sum())
