"""
Joints whose friction answers late, selected by left-out motions.

A joint whose rotor vanishes would have less inertia than a body can have: a late viscous friction,
which links with free parameters would stand in for, may explain that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import lag
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, MOST_SAMPLES
from lip_id_ros.identification.folds import largest_alike, recurrent_folds, STILL
from lip_id_ros.identification.left_out import Gain
from lip_id_ros.identification.residual_gp_selection import left_out_fits
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.rigid_body.chain import ROTOR

FOLDS, LEAST_FOLDS, SAMPLES = 6, 4, 600
"""Motions that are left out, the least number of different ones, and samples to predict."""

ROUNDS = (30, 30)
"""Evaluations of the descents with late friction, and without."""

NO_ROTOR = 0.1
"""Torque of a rotor in the usual acceleration, in residuals, below which there is none."""

LEAST_GAIN = float(np.log(4.0))
"""
Least decrease of the logarithm of left-out mean squares, summed over joints: the error of a joint
has to halve, for whatever else lacks in a model makes inertias a little too large.
"""


def with_lags(fitter: ArmFitter, fit: ArmFit) -> ArmFit:
    """Return a fit with late friction where there is no rotor, if it is better for sure."""
    some = fitter.some(MOST_SAMPLES)
    usual = np.maximum(np.sqrt(np.mean(some.ddq**2, axis=0)), 1e-9)
    least = NO_ROTOR * fit.noise.std / usual
    # the data identify neither the inertia of a joint that hardly moves, nor a lag of its friction
    moves = usual > STILL * largest_alike(usual, some.prismatic)
    joints = np.flatnonzero(moves & (fit.links[:, ROTOR] < least))
    if not joints.size:
        return fit
    rows = evenly(fitter.dataset.n_samples, SAMPLES)
    fold = recurrent_folds(fitter.dataset, FOLDS)[rows]
    if np.unique(fold).size < LEAST_FOLDS:
        return fit
    lagging = fitter.refined(some, _lagging(fitter, some, fit, joints, least[joints]), ROUNDS)
    now, then = (
        _left_out_squares(fitter, each, rows, fold)
        for each in (fitter.refined(some, fit, ROUNDS), lagging)
    )
    return lagging if Gain.between([now], [then]).is_sure(LEAST_GAIN) else fit


def _lagging(
    fitter: ArmFitter, some: Dataset, fit: ArmFit, joints: IndexArray, first: Array
) -> ArmFit:
    """Return a start with late friction of some joints, with their first coefficients."""
    basis = fit.friction.basis
    terms = tuple(DriveTerm(Drive.of_joint(joint), lag()) for joint in joints.tolist())
    coefficients = np.append(fit.friction.coefficients, first)
    friction = FrictionModel(replace(basis, terms=(*basis.terms, *terms)), coefficients)
    state = replace(fit.state, friction=np.pad(fit.state.friction, (0, first.size)))
    start = replace(fit, friction=friction, state=state)
    numbers = fitter.problem(some, start).friction_numbers(coefficients)
    return replace(start, state=replace(state, friction=numbers))


def _left_out_squares(fitter: ArmFitter, fit: ArmFit, rows: IndexArray, fold: IndexArray) -> Array:
    """Return mean squares of motions that all was fitted without, shape (K, n)."""
    masks = [(fold == k, -1) for k in np.unique(fold)]
    folds = left_out_fits(fitter, fit, rows, masks)
    return np.array([np.mean(each.residual[each.out] ** 2, axis=0) for each in folds])
