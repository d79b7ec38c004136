"""Torques that a plan will take, where they exceed limits, and how much slower it would fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import ConfigError, DataError, shortened
from lip_id_ros.feedforward.interpolation import Motion, Plan, Torques
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.signals.joints import by_joint

STEP_S = 0.005
"""Torques are looked at so often: limits are exceeded by jerks of tens of milliseconds."""

SLOWEST = 10.0
"""A plan that does not fit in ten times its time is no plan for this arm."""

GRID = 12
ACCURACY = 1e-3

MOST_WATCHED = 500
"""Samples that a factor is searched on: so many over the plan, and as many worst of each joint."""

MOST_LOOKS = 5
"""Times that all samples of a plan are looked at."""


@dataclass(frozen=True)
class JointLoad:
    """
    What a plan takes of one joint.

    `limit` [N m or N]. `tau`: the torque that is nearest to the limit or most beyond it, `std` its
    standard deviation, `at_s` its time [s]. `beyond_s`: begins and ends of the times at which the
    torque is beyond the limit [s].

    """

    joint: str
    limit: float
    tau: float
    std: float
    at_s: float
    beyond_s: tuple[tuple[float, float], ...]

    @property
    def excess(self) -> float:
        """By how much the torque exceeds the limit [N m or N], 0 where it does not."""
        return max(0.0, abs(self.tau) - self.limit)


@dataclass(frozen=True)
class PlanCheck:
    """
    What a plan takes of every joint.

    `duration_s` of the plan [s]. `scale`: the least factor on its times with which all torques are
    within limits, 1 where they are already, None where up to `SLOWEST` there is none. `caution`:
    what the torques lack, as a sentence, or empty.

    """

    loads: tuple[JointLoad, ...]
    duration_s: float
    scale: float | None
    caution: str = ''

    @property
    def fits(self) -> bool:
        """Whether no torque is beyond its limit."""
        return self.scale == 1.0


def check_plan(
    model: InverseDynamicsModel, plan: Plan, limits: Sequence[float], *, sigmas: float = 0.0
) -> PlanCheck:
    """
    Predict the torques of a plan as a joint_trajectory_controller interpolates it.

    Parameters
    ----------
    model : InverseDynamicsModel
    plan : Plan
        Of the model's joints, in any order, and of others, which are left out.
    limits : sequence of float, n or one for all
        Largest torques of the model's joints [N m or N].
    sigmas : float
        Standard deviations by which torques must stay away from the limits.

    Raises
    ------
    DataError
        If there is no model or no plan, or the plan lacks a joint.
    ConfigError
        If the limits are not positive, or not one per joint or one for all.

    """
    if not isinstance(model, InverseDynamicsModel) or not isinstance(plan, Plan):
        raise DataError(
            'check_plan takes an InverseDynamicsModel and a Plan, not '
            f'{shortened(model)} and {shortened(plan)}; read them from their files.'
        )
    model = model.with_rise_time(0.0)  # as `serve` does
    largest = _limits(limits, model.joint_names)
    ordered = plan.in_order(model.joint_names)

    def torques(q: Array, dq: Array, ddq: Array, t: Array) -> Array:
        tau = model.predict(q, dq, ddq, t).tau
        if not sigmas:
            return tau
        # away from zero: the side on which the limit is nearer
        return tau + np.copysign(sigmas * model.torque_std(q, dq, ddq, t), tau)

    t, states = ordered.motion(STEP_S)
    q, dq, ddq = states
    tau, std = model.predict(q, dq, ddq, t).tau, model.torque_std(q, dq, ddq, t)
    beyond = np.abs(tau) + sigmas * std > largest
    worst = np.argmax((np.abs(tau) + sigmas * std) / largest, axis=0)
    loads = tuple(
        JointLoad(
            joint,
            float(largest[n]),
            float(tau[row, n]),
            float(std[row, n]),
            float(t[row]),
            _intervals(t, beyond[:, n]),
        )
        for n, (joint, row) in enumerate(zip(model.joint_names, worst, strict=True))
    )
    scale = fitting_scale(torques, ordered, largest)
    return PlanCheck(loads, float(t[-1]), scale, plan.caution)


def fits(torques: Torques, plan: Plan, limits: Array) -> bool:
    """Return whether no torque of a plan is beyond its limit, shape (n,) [N m or N]."""
    return not _excess(torques, plan.motion(STEP_S), limits).any()


def fitting_scale(torques: Torques, plan: Plan, limits: Array) -> float | None:
    """
    Return the least factor on the times of a plan with which its torques are within limits.

    `limits`, shape (n,) [N m or N]. The way stays, velocities and accelerations become less:
    tau(q, dq / s, ddq / s^2). Without friction all larger factors fit too; with it few do not, so
    a grid is looked through up to `SLOWEST`, and halved where the plan first fits. None if it does
    not.

    A long plan is searched on few samples, among them the worst. All are looked at with the factor
    that is found, and where they do not fit, those that do not are searched too.

    """
    motion = plan.motion(STEP_S)
    excess = _excess(torques, motion, limits)
    watched = np.arange(0, len(motion.t), max(1, len(motion.t) // MOST_WATCHED))
    scale: float | None = 1.0
    for _ in range(MOST_LOOKS):
        if scale is None or not excess.any():
            return scale
        watched = np.union1d(watched, np.argsort(-excess, axis=0)[:MOST_WATCHED])
        scale = _least_scale(torques, motion.at(watched), limits, scale)
        if scale is not None:
            excess = _excess(torques, motion.slowed(scale), limits)
    return None if excess.any() else scale


def _least_scale(torques: Torques, motion: Motion, limits: Array, too_fast: float) -> float | None:
    """Return the least factor above `too_fast` with which a motion fits, None if none does."""
    for scale in np.geomspace(too_fast, SLOWEST, GRID)[1:].tolist():
        if not _excess(torques, motion.slowed(scale), limits).any():
            break
        too_fast = scale
    else:
        return None
    while scale - too_fast > ACCURACY * scale:
        middle = 0.5 * (too_fast + scale)
        if _excess(torques, motion.slowed(middle), limits).any():
            too_fast = middle
        else:
            scale = middle
    return float(scale)


def _excess(torques: Torques, motion: Motion, limits: Array) -> Array:
    """Return by how much torques are beyond their limits (N, n) [N m or N], 0 where they fit."""
    t, (q, dq, ddq) = motion
    tau = np.abs(torques(q, dq, ddq, t))
    return np.where(tau <= limits, 0.0, tau - limits)  # one that is no number does not fit


def _limits(limits: Sequence[float], joint_names: Sequence[str]) -> Array:
    try:
        values = [float(limit) for limit in limits]
    except (TypeError, ValueError):
        values = []
    if not values or not all(limit > 0.0 for limit in values):
        raise ConfigError(
            f'limits of torques must be numbers above 0, but are {shortened(limits)}; give one '
            'per joint, or one for all.'
        )
    return by_joint('limits', values, (), joint_names, np.inf)


def _intervals(t: Array, beyond: BoolArray) -> tuple[tuple[float, float], ...]:
    """Return the first and the last time of every run of samples that are marked."""
    edges = np.diff(np.concatenate([[False], beyond, [False]]).astype(np.int8))
    begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return tuple(zip(t[begins].tolist(), t[ends].tolist(), strict=True))
