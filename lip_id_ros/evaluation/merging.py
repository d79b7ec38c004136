"""Errors on several data sets together, from those on each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.evaluation.metrics import Evaluation, ROUNDING
from lip_id_ros.evaluation.near_rest import RestErrors


def merged(evaluations: Sequence[Evaluation]) -> Evaluation:
    """
    Return the errors of a model on one or several data sets together.

    They are what an evaluation of the joined samples has, the coverage is the mean weighted by
    samples; errors of energies, whose means are not known, are left out.
    """
    first, *others = evaluations
    if not others:
        return first
    counts = np.array([each.n_samples for each in evaluations])
    weights = counts / counts.sum()
    squares = weights @ np.square(_all(evaluations, 'rmse'))
    means = _all(evaluations, 'torque_mean')
    mean = weights @ means
    variances = np.square(_all(evaluations, 'torque_std')) + np.square(means - mean)
    variance = weights @ variances
    varies = np.sqrt(variance) > ROUNDING * np.abs(mean)
    nmse = np.where(varies, 100.0 * squares / np.where(varies, variance, 1.0), np.nan)
    known: dict[str, Any] = {}
    if all(each.within_two_std_percent is not None for each in evaluations):
        known['within_two_std_percent'] = _floats(
            weights @ _all(evaluations, 'within_two_std_percent')
        )
    rests = [each.rest for each in evaluations if each.rest is not None]
    if len(rests) == len(evaluations):
        known['rest'] = RestErrors.merged(rests, counts)
    if all(each.inertia_not_pd_percent is not None for each in evaluations):
        shares = _all(evaluations, 'inertia_not_pd_percent')
        smallest = _all(evaluations, 'inertia_min_eigenvalue')
        known['inertia_not_pd_percent'] = float(weights @ shares)
        known['inertia_min_eigenvalue'] = float(smallest.min())
    return Evaluation(
        joint_names=first.joint_names,
        joint_types=first.joint_types,
        n_samples=int(counts.sum()),
        nmse_percent=_floats(nmse),
        rmse=_floats(np.sqrt(squares)),
        torque_mean=_floats(mean),
        torque_std=_floats(np.sqrt(variance)),
        against_truth=all(each.against_truth for each in evaluations),
        kinetic_nmse_percent=None,
        potential_nmse_percent=None,
        cautions=tuple(dict.fromkeys(text for each in evaluations for text in each.cautions)),
        **known,
    )


def _all(evaluations: Sequence[Evaluation], name: str) -> Array:
    return np.array([getattr(each, name) for each in evaluations])


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(values.tolist())
