"""Mass, centre of mass and inertia of what is attached to the last link, the arm being known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.identification.levenberg_marquardt import minimise
from lip_id_ros.identification.payload_problem import (
    LoadedState,
    PayloadProblem,
    WeightedTorques,
)
from lip_id_ros.identification.possible_links import BarrierProblem
from lip_id_ros.identification.statistics import contiguous_blocks
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.residual_gp import ResidualGPMean
from lip_id_ros.rigid_body.pseudo_inertia import BODY, pseudo_inertia

ROUNDS, EVALUATIONS, TOLERANCE = 3, 100, 1e-6
BLOCKS = 50
LIGHTER = 4.0
"""A body of so many standard deviations below zero is a part that was taken off."""
STATES, SEED = 400, 0
"""Random states at which torques of the model stand for what it was learned from."""
LEAST_STD = 1e-6
"""Least standard deviation of a torque, in that of the recorded ones."""
BARRIERS = (1.0, 0.1, 0.01)
"""Weights of the barrier that keeps a body within those that can exist."""
LEAST_SAMPLES, MOST_SAMPLES = 50, 1000


@dataclass(frozen=True, eq=False)
class Payload:
    """A body that is fixed to the last link, in the frame of that link."""

    parameters: Array  # (10,), mass, first moments, xx xy xz yy yz zz about the origin
    covariance: Array  # (10, 10)

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return float(self.parameters[0])

    @property
    def mass_std(self) -> float:
        """Standard deviation of the mass [kg]."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def centre(self) -> Array:
        """Centre of mass, shape (3,) [m]."""
        return self.parameters[1:4] / self.mass

    @property
    def centre_std(self) -> Array:
        """Standard deviations of the centre of mass, shape (3,) [m]."""
        slope = np.column_stack([-self.centre, np.eye(3)]) / self.mass
        return np.sqrt(np.diagonal(slope @ self.covariance[:4, :4] @ slope.T))

    @property
    def inertia(self) -> Array:
        """Inertia about the centre of mass, shape (3, 3) [kg m^2]."""
        about_origin = np.empty((3, 3))
        upper = np.triu_indices(3)
        about_origin[upper] = about_origin.T[upper] = self.parameters[4:]
        c = self.centre
        return about_origin - self.mass * (c @ c * np.eye(3) - np.outer(c, c))


@dataclass(frozen=True, eq=False)
class LoadedArm:
    """An arm, and the body that is attached to it."""

    arm: ArmPosterior  # without the body, corrected by torques with it
    body: Array  # (10,), in the frame of the last link, as in `Payload`
    body_root: Array  # (10, r), root of the covariance beside `arm.covariance_root`


def identify_payload(model: InverseDynamicsModel, dataset: Dataset) -> LoadedArm:
    """
    Find what is attached to an arm, from at most `MOST_SAMPLES` samples in the order of time.

    A learned arm is uncertain too, above all in where its light last links turn. So it is fitted
    along: its torques at random states, with their standard deviations, stand for the recordings
    that it was learned from. A Gaussian process beside the links corrects the arm, whatever it
    carries: its posterior mean is subtracted from the recorded torques. One in place of a joint's
    links would not bear the payload: there the links explain the torque. The body returned can
    exist. Raises DataError if there are too few samples, or the arm is lighter than its model.
    """
    arm = model.arm
    assert arm is not None, 'a payload is fixed to a link'
    if dataset.n_samples < LEAST_SAMPLES:
        raise DataError(
            f'at least {LEAST_SAMPLES} samples were expected to find a payload, but '
            f'{dataset.n_samples} came; record some seconds of motion.'
        )
    rows = np.linspace(0, dataset.n_samples - 1, min(MOST_SAMPLES, dataset.n_samples))
    dataset = dataset.select(rows.astype(np.intp))
    q, dq, ddq = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
    tau = dataset.tau
    beside = None if model.residual_gp is None else model.residual_gp.beside_links()
    if beside is not None:
        tau = tau - ResidualGPMean(beside).torque(q, dq, ddq)
    least = LEAST_STD * np.maximum(tau.std(axis=0), np.finfo(float).tiny)
    bare = _bare(arm, model.training_range, least)
    std = np.maximum(arm.noise.std_at(dq), least)
    problem = PayloadProblem(arm, bare, WeightedTorques(q, dq, ddq, tau, std))
    at = problem.start()
    for _ in range(ROUNDS):
        at = minimise(problem, problem.evaluated(at), EVALUATIONS, TOLERANCE)
        problem = _reweighted(problem, at, least)
    at = _existing(problem, at)
    triangle = _triangle(problem, at)
    spread = np.asarray(solve_triangular(triangle, np.eye(len(triangle))))
    root = problem.parameter_map(at) @ spread
    return LoadedArm(replace(at.arm, covariance_root=root[:-BODY]), at.body, root[-BODY:])


def _bare(arm: ArmPosterior, ranges: tuple[Array, Array], least: Array) -> WeightedTorques:
    """
    Return torques that say of the arm what its posterior says, shape (STATES, n).

    A fit of p parameters to m torques of standard deviation s has a mean variance of s^2 p / m.
    """
    low, high = ranges
    rng = np.random.default_rng(SEED)
    shape = len(low), STATES, low.shape[1]
    q, dq, ddq = rng.uniform(low[:, None], high[:, None], shape)
    free = int(arm.covariance_root.any(axis=1).sum())
    spread = np.sqrt(np.mean(arm.torque_std(q, dq, ddq) ** 2, axis=0))
    std = np.maximum(spread * np.sqrt(q.size / max(free, 1)), least)
    return WeightedTorques(q, dq, ddq, arm.torque(q, dq, ddq), np.broadcast_to(std, q.shape))


def _existing(problem: PayloadProblem, at: LoadedState) -> LoadedState:
    """
    Return the state with the body that can exist and explains most.

    The arm stays: its torques with a body are linear in that. Raises DataError where the body is
    lighter than nothing.
    """
    if np.linalg.eigvalsh(pseudo_inertia(at.body))[0] > 0.0:
        return at
    triangle = _triangle(problem, at)
    spread = np.asarray(solve_triangular(triangle, np.eye(len(triangle))))
    mass_std = float(np.linalg.norm(spread[-BODY]))
    if at.body[0] < -LIGHTER * mass_std:
        raise DataError(
            f'the arm with its payload was expected to be heavier than the model, but is lighter '
            f'by {-at.body[0]:.3g} +- {mass_std:.2g} kg, as if the model had a tool; fit the arm '
            'without its tool.'
        )
    return problem.evaluated(replace(at, body=_existing_body(problem, at)))


def _triangle(problem: PayloadProblem, at: LoadedState) -> Array:
    """Return the triangular factor of all rows, those of the prior included."""
    return np.asarray(np.linalg.qr(_all_rows(problem, at), mode='r'))


def _all_rows(problem: PayloadProblem, at: LoadedState) -> Array:
    """Return the rows of torques and prior."""
    return np.concatenate([problem.rows(at), np.diag(problem.precision)])


def _reweighted(problem: PayloadProblem, at: LoadedState, least: Array) -> PayloadProblem:
    """
    Return the problem with the deviations that the residuals show.

    Residuals that are correlated in time count for less than their number. Where the torques with
    the body contradict the model, its deviations are larger than it says (Birge 1932).
    """
    triangle, rows = _triangle(problem, at), problem.rows(at)
    count, shape = problem.bare.tau.size, problem.loaded.tau.shape
    leverage = np.sum(solve_triangular(triangle, rows[count:].T, trans='T') ** 2, axis=0)
    determined = leverage.reshape(shape).sum(axis=0)
    residual = at.residual[count:].reshape(shape)
    squares = np.sum(residual**2, axis=0) / np.maximum(shape[0] - determined, 1.0)
    ratio = np.sqrt(squares * _correlation(residual))
    moved = np.sum(at.residual[:count] ** 2) / max(determined.sum() - BODY, 1.0)
    bare, loaded = problem.bare, problem.loaded
    return PayloadProblem(
        problem.arm,
        bare._replace(std=bare.std * np.sqrt(max(moved, 1.0))),
        loaded._replace(std=np.maximum(loaded.std * ratio, least)),
    )


def _correlation(residual: Array) -> Array:
    """Return the variances of means of blocks, in those of independent samples, (n,)."""
    block = contiguous_blocks(len(residual), min(BLOCKS, len(residual)))
    sums = np.zeros((int(block.max()) + 1, residual.shape[1]))
    np.add.at(sums, block, residual)
    squares = np.maximum(np.sum(residual**2, axis=0), np.finfo(float).tiny)
    return np.maximum(np.sum(sums**2, axis=0) / squares, 1.0)


def _existing_body(problem: PayloadProblem, at: LoadedState) -> Array:
    """Return the body that can exist and explains most beside the arm of a state."""
    rows = _all_rows(problem, at)[:, -BODY:]
    target = rows @ at.body + np.concatenate([at.residual, -problem.prior_residual(at)])
    triangle = np.linalg.qr(np.column_stack([rows, target]), mode='r')
    root, right = triangle[:-1, :-1], triangle[:-1, -1]
    mass = max(float(at.body[0]), 0.1)
    start = mass * np.array([1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.0, 0.01])
    return BarrierProblem.of_body(root.T @ root, root.T @ right).minimised(start, BARRIERS)
