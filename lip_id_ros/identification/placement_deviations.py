"""
Standard deviations of the parameters of Denavit and Hartenberg.

Placements take up what the model does not explain; the jackknife over left-out parts is true
whatever the residuals are (Efron and Tibshirani 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.identification.left_out_parts import solved
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.solution import (
    coordinates_of,
    Known,
    parts_about,
    Solution,
    system_of,
)
from lip_id_ros.identification.statistics import TorqueStatistics
from lip_id_ros.identification.total import Total
from lip_id_ros.rigid_body.denavit_hartenberg import DenavitHartenberg, table_std


def table_deviations(total: Total, solution: Solution, known: Known) -> DenavitHartenberg:
    """
    Return the larger of deviations by the posterior and by the jackknife, without elections.

    A length that was set to zero because no torque speaks against it is not known to be zero.
    """
    if not known.geometry.rigid:
        known = replace(known, geometry=Geometry.free(total.around.n_joints))
    noise, deviations = solution.left_out.unbiased_std, solution.deviations
    problem = system_of(total, known, noise, deviations, solution.inflation)
    state = problem.start()
    parts = parts_about(total, problem, state, noise, deviations)
    prior = coordinates_of(total, known).prior_rows(state)
    shown = jackknife_root(parts, prior, noise)
    first, size = total.around.basis.size, total.around.n_placements
    steps = problem.slopes(state)[first : first + size] @ shown
    roots = problem.covariance_root(state)[:size], steps
    return DenavitHartenberg(*np.max([table_std(solution.chain, root) for root in roots], axis=0))


def jackknife_root(parts: Sequence[TorqueStatistics], prior: Array, noise_std: Array) -> Array:
    """
    Return a root (m, K) of the parameters' covariance by leaving out parts.

    Parameters are as in `left_out_parts.measure_left_out`.
    """
    grams = np.array([[r.T @ r for r in part.factors] for part in parts])
    rest = grams.sum(axis=0) - grams
    steps = np.stack([solved(each, prior, noise_std)[0] for each in rest], axis=1)
    count = len(parts)
    return np.asarray(np.sqrt((count - 1) / count) * (steps - steps.mean(axis=1, keepdims=True)))
