"""
Whether a model is proven.

Judged on motion that it had not seen, and better than the mean there. By errors that the fit
stores of motion left out, or by samples held out of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
import math
from typing import Any

from lip_id_ros.model.inverse_dynamics_model import InverseDynamicsModel

LEAST_NEW_S = 4.0
"""New motion of the training data, four left-out parts of a second each [s]."""

LEAST_HELD_OUT_S = 1.0
"""Motion of held-out samples that the training data do not have [s]."""

MEAN_PERCENT = 100.0
"""Error of the mean of a torque, in percent of its variance."""


def with_held_out(
    model: InverseDynamicsModel, nmse_percent: Sequence[float], new_motion_s: float
) -> InverseDynamicsModel:
    """
    Add to the summary of a model how it predicts samples that were held out of its fit.

    `nmse_percent`: per joint, not a number where the torque is constant. `new_motion_s`: for how
    long they are in motion that the training data do not have [s].
    """
    known = [None if math.isnan(value) else value for value in nmse_percent]
    judged = {'nmse_percent': known, 'new_motion_s': round(new_motion_s, 3)}
    return replace(model, summary={**model.summary, 'held_out': judged})


def missing_proof(model: InverseDynamicsModel) -> str | None:
    """Return what a model lacks to be proven and what to do, in half a sentence, or None."""
    summary = model.summary
    left_out, held_out = summary.get('unexplained_percent'), summary.get('held_out')
    if left_out is None or 'new_motion_s' not in summary:
        return 'its file does not say on what motion it was judged; fit again'
    return (
        _useless(model.joint_names, left_out, 'left-out')
        or _useless(model.joint_names, held_out['nmse_percent'] if held_out else (), 'held-out')
        or _unseen(_left_out_s(model), held_out)
    )


def _left_out_s(model: InverseDynamicsModel) -> float:
    """
    Return for how long the motion was unseen that the fit left out [s].

    An arm leaves out a motion with its repetitions, a process on energies blocks of time: of those
    only motion that comes once is unseen.
    """
    every, new = (float(model.summary[name]) for name in ('motion_s', 'new_motion_s'))
    return new if model.process is None else max(new - (every - new), 0.0)


def _useless(joint_names: Sequence[str], percent: Sequence[float | None], what: str) -> str | None:
    pairs = zip(joint_names, percent, strict=False)
    found = [(name, x) for name, x in pairs if x is not None and not x < MEAN_PERCENT]
    if not found:
        return None
    errors = ', '.join(f'{name} ({x:.3g} %)' for name, x in found)
    return (
        f'on {what} motion it predicts no better than the mean of the torque at {errors}; check '
        'the recording with lip_id inspect, or record more motion'
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
