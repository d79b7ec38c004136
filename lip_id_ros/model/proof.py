"""
What a fit's summary has of its quality.

Checks of M(q) and errors, and whether it is proven. Proven is a model that was judged on motion
that it had not seen, and better than the mean there: by errors of motion left out of the fit, or
by samples held out of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
import math
from typing import Any, TypeGuard

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.model.inverse_dynamics_model import InverseDynamicsModel

LEAST_NEW_S = 4.0
"""New motion of the training data, four left-out parts of a second each [s]."""

LEAST_HELD_OUT_S = 1.0
"""Motion of held-out samples that the training data do not have [s]."""

USELESS_PERCENT = 80.0
"""
Error of a joint in percent of its torque's variance, from which on a prediction is hardly better
than the mean of the torque, whose error is 100.
"""


def with_held_out(
    model: InverseDynamicsModel, nmse_percent: Sequence[float], new_motion_s: float
) -> InverseDynamicsModel:
    """
    Add to the summary of a model how it predicts samples that were held out of its fit.

    `nmse_percent`: per joint, not a number where the torque is constant. `new_motion_s`: for how
    long they are in motion that the training data do not have [s].
    """
    judged = {'nmse_percent': known_errors(nmse_percent), 'new_motion_s': round(new_motion_s, 3)}
    return replace(model, summary={**model.summary, 'held_out': judged})


def has_held_out(model: InverseDynamicsModel, nmse_percent: Sequence[float]) -> bool:
    """Return whether a model has these errors on held-out samples in its summary."""
    held_out = model.summary.get('held_out')
    return held_out is not None and held_out['nmse_percent'] == known_errors(nmse_percent)


def known_errors(nmse_percent: Sequence[float]) -> list[float | None]:
    """Return errors with None where the torque is constant, and the error not a number."""
    return [None if math.isnan(value) else value for value in nmse_percent]


def missing_proof(model: InverseDynamicsModel) -> str | None:
    """Return what a model lacks to be proven and what to do, in half a sentence, or None."""
    summary = model.summary
    left_out, held_out = summary.get('unexplained_percent') or (), summary.get('held_out')
    judged = (('left-out', left_out), ('held-out', held_out['nmse_percent'] if held_out else ()))
    if useless := useless_on(model.joint_names, judged):
        return useless
    if not left_out or 'new_motion_s' not in summary:
        return 'its file does not say on what motion it was judged; fit again'
    return _unseen(_left_out_s(model), held_out)


def _left_out_s(model: InverseDynamicsModel) -> float:
    """
    Return for how long the motion was unseen that the fit left out [s].

    An arm leaves out a motion with its repetitions, a process on energies blocks of time: of those
    only motion that comes once is unseen.
    """
    every, new = (float(model.summary[name]) for name in ('motion_s', 'new_motion_s'))
    return new if model.process is None else max(new - (every - new), 0.0)


def is_useless(nmse_percent: float | None) -> TypeGuard[float]:
    """Return whether an error is hardly smaller than that of the torque's mean, or no number."""
    return nmse_percent is not None and not nmse_percent < USELESS_PERCENT


def useless_on(
    joint_names: Sequence[str], judged: Sequence[tuple[str, Sequence[float | None]]]
) -> str | None:
    """
    Return on what motions a model is useless at which joints and what to do, in half a sentence.

    `judged`: motions with the error of each joint [%], which is None where the torque is constant.
    None where there is no such joint.

    """
    texts = []
    for what, errors in judged:
        pairs = zip(joint_names, errors, strict=False)
        if found := [f'{name} ({x:.3g} %)' for name, x in pairs if is_useless(x)]:
            where = f'{len(found)} of {len(joint_names)} joints (error in % of the variance)'
            hardly = 'it predicts hardly better than the mean of the torque'
            texts.append(f'on {what} motion {hardly} at {where}: {", ".join(found)}')
    if not texts:
        return None
    return (
        f'{", and ".join(texts)}; check the efforts, the order and the types of the joints with '
        'lip_id inspect of the recording, and record more motion'
    )


def _unseen(left_out_s: float, held_out: Mapping[str, Any] | None) -> str | None:
    """Return why errors are not those of unseen motion."""
    held_out_s = float(held_out['new_motion_s']) if held_out else 0.0
    if left_out_s >= LEAST_NEW_S or held_out_s >= LEAST_HELD_OUT_S:
        return None
    lack = 'no samples were held out of its fit'
    if held_out is not None:
        lack = f'its held-out samples have {held_out_s:.2g} s of motion that its training lacks'
        lack += f' (at least {LEAST_HELD_OUT_S:g} s)'
    return (
        f'its recording has {left_out_s:.2g} s of motion that is not repeated (at least '
        f'{LEAST_NEW_S:g} s), and {lack}; record more motion, or hold samples out (fit --holdout, '
        'holdout of train)'
    )


MOST_CHECKED = 1000
"""Samples at which M(q) is checked, at most."""


def with_checks(model: InverseDynamicsModel, q: Array, tau: Array) -> InverseDynamicsModel:
    """
    Add checks to the summary of a model.

    `inertia_not_pd_percent` is the share of samples at which M(q) is not positive definite,
    `inertia_min_eigenvalue` its smallest eigenvalue at any of them [kg m^2 or kg], and
    `unexplained_percent` the noise variance of each joint, or its error on left-out blocks where
    that is larger, in percent of the variance of its torque (None where that is constant).

    `q`, `tau`, shape (N, n): positions and torques of the samples of its fit [rad or m, N m or N].
    """
    inertia = model.inertia_matrix(q[:: 1 + len(q) // MOST_CHECKED])
    smallest = np.linalg.eigvalsh(inertia)[:, 0]
    variance = tau.var(axis=0)
    squares = np.maximum(model.noise_std**2, _left_out_squares(model, variance))
    checks: dict[str, Any] = {
        'inertia_not_pd_percent': not_positive_definite_percent(smallest),
        'inertia_min_eigenvalue': float(smallest.min()),
        'unexplained_percent': [
            100.0 * float(square) / float(total) if total > 0.0 else None
            for square, total in zip(squares, variance, strict=True)
        ],
    }
    return replace(model, summary={**model.summary, **checks})


def not_positive_definite_percent(smallest_eigenvalue: Array) -> float:
    """Share [percent] of inertia matrices whose smallest eigenvalue (N,) is not positive."""
    return 100.0 * float(np.mean(smallest_eigenvalue <= 0))


def _left_out_squares(model: InverseDynamicsModel, variance: Array) -> Array:
    """Return mean squares of predictions' errors on left-out blocks; 0 where not known, (n,)."""
    known = model.summary.get('unexplained_left_out')
    shares = model.summary.get('unpredicted_left_out', known)
    if shares is None:
        return np.zeros(len(variance))
    # the noise of a joint with a Gaussian process is its error on left-out blocks
    has_process = model.residual_gp.joints if model.residual_gp else np.zeros(len(variance), bool)
    return np.where(has_process, 0.0, np.asarray(shares) * variance)
