"""
The search for placements, once more with springs where these explain torques.

A strong spring, as of a counterbalance, looks like gravity of a link in a wrong place, so that the
search ends in a wrong minimum. A descent from there with springs lowers the residuals
(docs/maths.md, section 10).

"""

from __future__ import annotations

import numpy as np

from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.placement_search import Calibration
from lip_id_ros.progress import Progress

PROBE = 0.5
"""
Decrease of the logarithm of a joint's residual, by a descent with springs from the minima of a
search without them, that is worth another search.
"""

LEAST_RESIDUAL = 0.02
"""The same of that residual, as a share of the torque's deviation; places are right below."""

LEAST_GAIN = 0.1
"""Least decrease of the mean logarithm of the joints' left-out residuals by the other search."""


def find_placements(
    fitter: ArmFitter, seed: int, progress: Progress
) -> tuple[ArmFitter, Calibration]:
    """
    Find the placements of the joints, with springs if these predict left-out blocks better.

    Parameters
    ----------
    fitter : ArmFitter
    seed : int
        Of the starts.
    progress : callable

    Returns
    -------
    ArmFitter
        The one given, or one whose search has springs.
    Calibration

    Raises
    ------
    FitError
        If the data are not finite in units of the noise.

    """
    found = fitter.calibrated(seed, progress)
    is_large = found.noise_std > LEAST_RESIDUAL * fitter.torque_std
    if fitter.is_described or not is_large.any():
        return fitter, found
    sprung = fitter.with_springs()
    probed = sprung.recalibrated(found)
    if not (is_large & (np.log(found.noise_std / probed.noise_std) > PROBE)).any():
        return fitter, found
    other = sprung.calibrated(seed, progress)
    gain = _log_left_out(fitter, found) - _log_left_out(sprung, other)
    return (sprung, other) if gain >= LEAST_GAIN else (fitter, found)


def _log_left_out(fitter: ArmFitter, found: Calibration) -> float:
    """Return the mean logarithm of the joints' left-out residuals, with elected friction."""
    return float(np.log(fitter.elected(found.placements.chain).noise.std).mean())
