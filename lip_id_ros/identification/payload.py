"""
What is attached to the last link: its mass, centre of mass and inertia, the arm being known.

A body fixed to the last link adds its parameters to those of the link. So torques are linear in
ten numbers, which some seconds of motion determine. The arm stays as it is, but for what its own
covariance allows.

"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.identification.statistics import contiguous_blocks
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import pseudo_inertia
from lip_id_ros.rigid_body.regressor import torque_regressor

BODY = LINK_PARAMETERS - 1
"""Number of parameters of a body: those of a link without its rotor."""
MASS, LENGTH = 10.0, 0.3
"""Prior standard deviations of a payload's mass [kg] and of where it is [m]."""
PRIOR_STD = MASS * np.repeat([1.0, LENGTH, LENGTH**2], [1, 3, 6])
ROUNDS, BLOCKS = 4, 20
ROUNDING = 1e-14
BARRIERS, ITERATIONS, CONVERGED, SHORTEST = (1.0, 0.1, 0.01), 50, 1e-8, 1e-10
LEAST_SAMPLES, MOST_SAMPLES = 50, 2000


@dataclass(frozen=True, eq=False)
class Payload:
    """
    A body that is fixed to the last link, in the frame of that link.

    Attributes
    ----------
    parameters : array, shape (10,)
        Mass, first moments, inertias xx xy xz yy yz zz about the origin of the frame.
    covariance : array, shape (10, 10)
        Of the parameters.

    """

    parameters: Array
    covariance: Array

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


def identify_payload(arm: ArmPosterior, dataset: Dataset) -> Payload:
    """
    Find what is attached to an arm.

    A learned arm is uncertain too: its parameters may differ by what their covariance allows, or
    an error of a length would count as mass.

    Parameters
    ----------
    arm : ArmPosterior
        Without the payload.
    dataset : Dataset
        Of the arm with its payload, in the order of time; at most `MOST_SAMPLES` are used.

    Returns
    -------
    Payload
        A body that can exist. Its covariance is the sandwich estimate over contiguous blocks of
        the residuals, which are correlated in time (Liang and Zeger 1986).

    Raises
    ------
    DataError
        If there are too few samples.

    """
    if dataset.n_samples < LEAST_SAMPLES:
        raise DataError(
            f'at least {LEAST_SAMPLES} samples were expected to find a payload, but '
            f'{dataset.n_samples} came; record some seconds of motion.'
        )
    rows = np.linspace(0, dataset.n_samples - 1, min(MOST_SAMPLES, dataset.n_samples))
    dataset = dataset.select(rows.astype(np.intp))
    state = [np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq)]
    features = torque_regressor(arm.chain, *state)[:, :, -LINK_PARAMETERS:-1]
    body, std = np.zeros(BODY), np.std(dataset.tau, axis=0)
    for _ in range(ROUNDS):
        loaded = with_body(arm, body)
        own = loaded.jacobian(*state) @ arm.covariance_root
        target = dataset.tau - loaded.torque(*state) + features @ body
        std = np.where(std > 0.0, std, 1.0)
        columns = np.concatenate([own, features], axis=2)
        triangle = _triangle(columns / std[:, None], target / std)
        known = own.shape[2]
        root, right = triangle[known:-1, known:-1], triangle[known:-1, -1]
        body = _existing(root, right)
        corrections = solve_triangular(
            triangle[:known, :known], triangle[:known, -1] - triangle[:known, known:-1] @ body
        )
        residual = target - columns @ np.concatenate([corrections, body])
        std = np.sqrt(np.mean(residual**2, axis=0))
    std = np.where(std > 0.0, std, 1.0)
    scores = np.einsum('tik,ti->tk', columns / std[:, None] ** 2, residual)
    return Payload(body, _sandwich(triangle[:-1, :-1], scores)[known:, known:])


def with_body(arm: ArmPosterior, body: Array) -> ArmPosterior:
    """Return the arm with a body fixed to its last link."""
    links = arm.links.copy()
    links[-1, :BODY] += body
    return replace(arm, links=links)


def _prior_precision(size: int) -> Array:
    """Return precisions of corrections of the arm, in units of its covariance, and of the body."""
    return np.concatenate([np.ones(size - BODY), 1.0 / PRIOR_STD])


def _triangle(columns: Array, target: Array) -> Array:
    """Return the triangular factor of columns and target, the prior included."""
    size = columns.shape[2]
    rows = np.concatenate([columns.reshape(-1, size), np.diag(_prior_precision(size))])
    values = np.concatenate([target.ravel(), np.zeros(size)])
    return np.asarray(np.linalg.qr(np.column_stack([rows, values]), mode='r'))


def _existing(root: Array, right: Array) -> Array:
    """
    Return the body that can exist and explains most.

    Where the unconstrained solution cannot exist, a logarithmic barrier keeps the pseudo-inertia
    positive definite: a convex problem, solved by Newton's method.

    """
    free = np.asarray(solve_triangular(root, right))
    if np.linalg.eigvalsh(pseudo_inertia(free))[0] > 0.0:
        return free
    problem = _BarrierProblem(root, right)
    mass = max(float(free[0]), 0.1)
    at = mass * np.array([1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.0, 0.01, 0.0, 0.01])
    for barrier in BARRIERS:
        at = problem.minimised(at, barrier)
    return at


class _BarrierProblem:
    """Minimise |R x - z|^2 / 2 - barrier log det J(x)."""

    def __init__(self, root: Array, right: Array) -> None:
        self._root, self._right = root, right
        self._units = pseudo_inertia(np.eye(BODY))

    def minimised(self, at: Array, barrier: float) -> Array:
        """Descend from a body that can exist."""
        for _ in range(ITERATIONS):
            inverse = np.linalg.inv(pseudo_inertia(at))
            inner = inverse @ self._units
            gradient = self._root.T @ (self._root @ at - self._right)
            gradient -= barrier * np.trace(inner, axis1=1, axis2=2)
            curvature = barrier * np.einsum('kab,lba->kl', inner, inner)
            step = _newton_step(self._root.T @ self._root + curvature, gradient)
            decrease = float(-gradient @ step)
            if decrease < CONVERGED:
                break
            at = at + self._length(at, step, decrease, barrier) * step
        return at

    def _length(self, at: Array, step: Array, decrease: float, barrier: float) -> float:
        """Halve a step until it stays inside and gains what its slope promises."""
        value, length = self._value(at, barrier), 1.0
        while length > SHORTEST:
            if self._value(at + length * step, barrier) <= value - 0.1 * length * decrease:
                return length
            length *= 0.5
        return 0.0

    def _value(self, at: Array, barrier: float) -> float:
        try:
            factor = np.linalg.cholesky(pseudo_inertia(at))
        except np.linalg.LinAlgError:
            return np.inf
        misfit = self._root @ at - self._right
        return float(0.5 * misfit @ misfit - 2.0 * barrier * np.log(np.diagonal(factor)).sum())


def _sandwich(root: Array, scores: Array) -> Array:
    inverse = solve_triangular(root, np.eye(len(root)))
    hessian_inverse = inverse @ inverse.T
    block = contiguous_blocks(len(scores), min(BLOCKS, len(scores)))
    sums = np.zeros((int(block.max()) + 1, len(root)))
    np.add.at(sums, block, scores)
    # The prior is what is known of directions that the motion does not show.
    spread = sums.T @ sums + np.diag(_prior_precision(len(root)) ** 2)
    return np.asarray(hessian_inverse @ spread @ hessian_inverse)


def _newton_step(hessian: Array, gradient: Array) -> Array:
    """Solve in units of the diagonal, with as much of it added as rounding takes away."""
    scale = np.sqrt(np.diagonal(hessian))
    scaled = hessian / np.multiply.outer(scale, scale) + ROUNDING * np.eye(len(hessian))
    return np.asarray(-np.linalg.solve(scaled, gradient / scale) / scale)
