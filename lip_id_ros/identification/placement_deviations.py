"""
Standard deviations of the parameters of Denavit and Hartenberg.

Placements take up what the links and friction of a real arm do not explain, by more than their
posterior says. How much shows where blocks of the time are left out: the jackknife over these is
true whatever the residuals are, as long as they differ between blocks (Efron and Tibshirani 1993).

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter
from lip_id_ros.identification.laplace import (
    block_statistics,
    covariance_root,
    LeftOut,
    prior_rows,
    solved,
)
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.statistics import TorqueStatistics
from lip_id_ros.rigid_body.denavit_hartenberg import DenavitHartenberg, table_std
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS


def table_deviations(fitter: ArmFitter, fit: ArmFit, left_out: LeftOut) -> DenavitHartenberg:
    """
    Return the larger of the deviations by the posterior and by the jackknife, without elections.

    A length that was set to zero because no torque speaks against it is not known to be zero.

    """
    free = fit
    if not fit.geometry.rigid:
        free = replace(fit, geometry=Geometry.free(len(fit.links)))
    blocks = block_statistics(fitter, free)
    problem = fitter.problem(fitter.some(1), free)
    size = DIRECTIONS * len(fit.links)
    prior = prior_rows(problem, free.state)
    shown = jackknife_root(blocks, prior, left_out.unbiased_std)[:size]
    roots = (
        covariance_root(fitter, free, blocks, left_out)[:size],
        problem.geometry.projector(free.state.chain) @ shown,
    )
    return DenavitHartenberg(*np.max([table_std(fit.chain, root) for root in roots], axis=0))


def jackknife_root(blocks: Sequence[TorqueStatistics], prior: Array, noise_std: Array) -> Array:
    """
    Return a square root of the covariance of parameters by leaving out blocks, shape (m, K).

    Parameters are as in `laplace.measure_left_out`.

    """
    grams = np.array([[r.T @ r for r in block.factors] for block in blocks])
    rest = grams.sum(axis=0) - grams
    steps = np.stack([solved(each, prior, noise_std)[0] for each in rest], axis=1)
    count = len(blocks)
    return np.asarray(np.sqrt((count - 1) / count) * (steps - steps.mean(axis=1, keepdims=True)))
