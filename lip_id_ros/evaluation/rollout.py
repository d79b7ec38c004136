"""
Forward simulation of recorded motions: how far an arm strays that is driven by measured torques.

Inverse dynamics are judged by torques; who simulates, plans or controls with a model relies on its
accelerations. So windows of a recording are simulated from their measured first state, with the
measured torques and a weak feedback, and the simulated motion is compared with the measured one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline, interp1d

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.errors import DataError
from lip_id_ros.friction.model import FrictionModel, plain_friction
from lip_id_ros.model.forward_dynamics import ForwardDynamics
from lip_id_ros.rigid_body.chain import NO_COUPLINGS

HORIZONS_S = (0.1, 1.0)
FEEDBACK = 2.0
"""
Natural frequency of the feedback, critically damped [rad/s]: it takes half a second to bring the
arm back, so that 0.1 s are as good as free and an arm that would topple stays near for 1 s.
"""
STEP_S = 1e-3
LONGEST_STEP_S = 0.1
"""Of samples between which torques are interpolated: a longer one is a hole."""
MOST_WINDOWS = 50
BLOCK = 10_000  # samples whose inertia matrices are in memory at once
FASTEST = 100.0
"""Velocity at which a simulation that diverges is stopped [rad/s or m/s]."""
NOMINAL_SIGN_WIDTH = 0.01
"""Of the Coulomb friction of a URDF, whose sign jumps [rad/s or m/s]."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """
    Errors of simulated windows of one length.

    `position`, `velocity`, shape (n,): root mean squares of simulated minus measured, over all
    samples of all windows [rad or m, and per second]. `travel`, shape (n,): that of measured
    positions relative to the beginning of their window.
    """

    horizon_s: float
    windows: int
    position: Array
    velocity: Array
    travel: Array

    @property
    def title(self) -> str:
        """What was simulated."""
        return f'{self.windows} windows of {self.horizon_s:g} s, feedback of {FEEDBACK:g} rad/s'

    def to_json(self) -> dict[str, object]:
        """Return the errors for a JSON file."""
        return {
            'horizon_s': self.horizon_s,
            'windows': self.windows,
            'position': self.position.tolist(),
            'velocity': self.velocity.tolist(),
            'travel': self.travel.tolist(),
        }


class Rollouts(NamedTuple):
    """
    Errors of a model, and of the arm of a URDF where there is one, for each of `HORIZONS_S`.

    `floor`: what remains of the model's errors with exact torques.
    """

    model: tuple[Rollout, ...]
    floor: tuple[Rollout, ...]
    urdf: tuple[Rollout, ...] | None = None

    def to_json(self) -> dict[str, object]:
        """Return the errors for a JSON file."""
        arms = {name: rollouts for name, rollouts in self._asdict().items() if rollouts}
        errors = {name: [x.to_json() for x in rollouts] for name, rollouts in arms.items()}
        return {'feedback_rad_s': FEEDBACK, **errors}


def rollout_cautions(rollouts: Rollouts, joint_names: Sequence[str]) -> list[str]:
    """Return a sentence for each length of windows in which errors exceed the travel."""
    texts = []
    for each in rollouts.model:
        lost = np.asarray(joint_names)[each.position >= each.travel].tolist()
        if lost:
            texts.append(
                f'In windows of {each.horizon_s:g} s the errors of the simulated motion exceed '
                f'the travel at {", ".join(lost)}: it is no better there than an arm at rest.'
            )
    return texts


def nominal_arm(
    description: RobotDescription, gravity_compensated: bool, couplings: Array = NO_COUPLINGS
) -> ForwardDynamics:
    """
    Return the arm of a URDF with its friction, without gravity if that is compensated.

    `couplings`, shape (k, 3): of the recorded positions, as in `Chain`; a URDF knows none.
    """
    n = len(description.joint_names)
    coefficients = np.column_stack([description.damping, description.friction, np.zeros(n)])
    basis = plain_friction(n, np.full(n, NOMINAL_SIGN_WIDTH))
    friction = FrictionModel(basis, coefficients.ravel())
    gravity = np.zeros(3) if gravity_compensated else description.chain.gravity
    chain = description.chain._replace(gravity=gravity, couplings=couplings)
    return ForwardDynamics(chain, description.links, friction)


def roll_out(arm: ForwardDynamics, dataset: Dataset) -> tuple[Rollout, ...]:
    """
    Simulate windows of unseen samples in the order of time, one result for each of `HORIZONS_S`.

    DataError if no uninterrupted motion is long enough, or the arm has no inertia.
    """
    found = (_rolled_out(arm, dataset, horizon) for horizon in HORIZONS_S)
    results = tuple(each for each in found if each is not None)
    if not results:
        raise DataError(
            f'a rollout needs an uninterrupted motion of at least {HORIZONS_S[0]:g} s, with '
            f'samples at most {LONGEST_STEP_S:g} s apart, but there is none; evaluate a longer '
            'recording, or a data set of more samples.'
        )
    return results


def floor(arm: ForwardDynamics, dataset: Dataset) -> tuple[Rollout, ...]:
    """Return the errors of `roll_out` with the arm's own torques: of samples and steps alone."""
    blocks = np.array_split(np.arange(dataset.n_samples), dataset.n_samples // BLOCK + 1)
    exact = [
        arm.torque(*(x[rows] for x in (dataset.q, dataset.dq, dataset.ddq))) for rows in blocks
    ]
    return roll_out(arm, replace(dataset, tau=np.concatenate(exact)))


def _rolled_out(arm: ForwardDynamics, dataset: Dataset, horizon: float) -> Rollout | None:
    starts = window_starts(dataset, horizon)
    if starts.size == 0:
        return None
    position, velocity = simulated(arm, dataset, starts, horizon)
    rms = np.sqrt(_error_squares(dataset, starts, horizon, position, velocity))
    return Rollout(horizon, starts.size, rms[0], rms[1], rms[2])


def window_starts(dataset: Dataset, horizon: float) -> IndexArray:
    """Return rows at which windows of a length begin, evenly chosen, that hold other samples."""
    last = _last_without_hole(dataset)
    fits = dataset.t + horizon <= dataset.t[last]
    candidates = np.flatnonzero(fits)
    chosen = np.linspace(0, candidates.size - 1, min(MOST_WINDOWS, candidates.size))
    return candidates[np.unique(chosen.astype(np.intp))]


def _last_without_hole(dataset: Dataset) -> IndexArray:
    """Return the last row before the next hole, or end of a segment, of every sample, (N,)."""
    holes = (np.diff(dataset.segment) != 0) | (np.diff(dataset.t) > LONGEST_STEP_S)
    ends = np.flatnonzero(np.append(holes, True))
    return ends[np.searchsorted(ends, np.arange(dataset.n_samples))]


def simulated(
    arm: ForwardDynamics, dataset: Dataset, starts: IndexArray, horizon: float
) -> tuple[Array, Array]:
    """Return simulated positions and velocities (K + 1, W, n) at K steps of about `STEP_S`."""
    references = measured_between(dataset, starts, round(horizon / STEP_S))
    q, dq = dataset.q[starts].copy(), dataset.dq[starts].copy()
    ddq = dataset.ddq[starts].copy()
    positions, velocities = [q], [dq]
    for reference, rate, tau in zip(*references, strict=True):
        ddq = arm.acceleration(q, dq, tau, ddq, STEP_S)
        ddq = ddq + FEEDBACK**2 * (reference - q) + 2.0 * FEEDBACK * (rate - dq)
        faster = np.clip(dq + STEP_S * ddq, -FASTEST, FASTEST)
        q, dq = q + 0.5 * STEP_S * (dq + faster), faster
        positions.append(q)
        velocities.append(dq)
    return np.array(positions), np.array(velocities)


def measured_between(dataset: Dataset, starts: IndexArray, steps: int) -> Array:
    """Return measured positions, velocities and torques of all steps, shape (3, K, W, n)."""
    out = np.empty((3, steps, starts.size, dataset.n_joints))
    last = _last_without_hole(dataset)
    for w, start in enumerate(starts):
        to_end = dataset.t[start : last[start] + 1]
        rows = start + np.arange(np.searchsorted(to_end, to_end[0] + steps * STEP_S) + 1)
        rows = rows[rows <= last[start]]
        rows = rows[np.diff(dataset.t[rows], prepend=-np.inf) > 0.0]
        t = dataset.t[rows]
        motion = CubicHermiteSpline(t, dataset.q[rows], dataset.dq[rows])
        at = t[0] + STEP_S * np.arange(steps)
        torque = interp1d(t, dataset.tau[rows], axis=0, assume_sorted=True)
        out[:, :, w] = motion(at), motion(at, 1), torque(at)
    return out


def _error_squares(
    dataset: Dataset, starts: IndexArray, horizon: float, position: Array, velocity: Array
) -> Array:
    """Return mean squares of the errors of position and velocity and of the travel, (3, n)."""
    sums, count = np.zeros((3, dataset.n_joints)), 0
    last = _last_without_hole(dataset)
    for w, start in enumerate(starts):
        rows = np.arange(start + 1, last[start] + 1)
        rows = rows[dataset.t[rows] <= dataset.t[start] + horizon]
        at = (dataset.t[rows] - dataset.t[start]) / STEP_S
        q, dq = (_between(x[:, w], at) for x in (position, velocity))
        errors = q - dataset.q[rows], dq - dataset.dq[rows], dataset.q[rows] - dataset.q[start]
        sums += np.array([np.sum(each**2, axis=0) for each in errors])
        count += rows.size
    return sums / count


def _between(values: Array, at: Array) -> Array:
    left = np.clip(at.astype(np.intp), 0, len(values) - 2)
    share = (at - left)[:, None]
    return np.asarray((1.0 - share) * values[left] + share * values[left + 1])
