"""
Links that can exist and give the same torques.

A fit without constraints returns some of the many parameters that give the same torques, mostly
of bodies that cannot exist: torques depend on the base parameters only. Among all parameters
with the same base parameters there may be those of bodies with positive density.

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.rigid_body.chain import Chain, LINK_PARAMETERS, ROTOR
from lip_id_ros.rigid_body.pseudo_inertia import link_parameters, pseudo_inertia
from lip_id_ros.rigid_body.regressor import torque_regressor

UNIDENTIFIED = 1e-11
"""Relative singular value of the regressor below which a direction changes no torque."""
STATES_PER_PARAMETER = 4
RADIUS, SHORTEST = 0.05, 0.1
"""Of the rods that unidentified parameters are drawn to [m]."""
RELAXATIONS = 10.0 ** -np.arange(0.0, 10.0, 2.0)
MULTIPLIER_STEPS = 20
ITERATIONS = 60
CONVERGED = 1e-9
JITTER = 1e-14


class ConsistentLinks(NamedTuple):
    """
    Parameters of links that can exist.

    Attributes
    ----------
    parameters : array, shape (n, 11)
    torque_change : array, shape (n,)
        Root mean square of the change of each joint's torque over that of its torque; zero where
        parameters with the same torques were found.

    """

    parameters: Array
    torque_change: Array


class Directions(NamedTuple):
    """
    Orthogonal directions in the space of all parameters of an arm.

    Attributes
    ----------
    vectors : array, shape (11 n, 11 n)
        Changes of parameters, in columns.
    gains : array, shape (11 n,)
        Root mean square of the relative change of torques; zero where there is none.

    """

    vectors: Array
    gains: Array


def are_consistent(parameters: Array) -> bool:
    """Whether all links can exist: pseudo-inertias positive definite, rotors not negative."""
    smallest = np.linalg.eigvalsh(pseudo_inertia(parameters))[:, 0]
    return bool((smallest > 0.0).all() and (parameters[:, ROTOR] >= 0.0).all())


def consistent_links(chain: Chain, parameters: Array) -> ConsistentLinks:
    """
    Find links that can exist, with the same torques or, where there are none, with similar ones.

    Of all that give the same torques, those with the smallest entropic divergence from uniform
    rods along the links are taken (Lee, Wensing and Park, "Geometric Robot Dynamic
    Identification: A Convex Programming Approach", 2020): a convex problem, solved by Newton's
    method.

    Parameters
    ----------
    chain : Chain
    parameters : array, shape (n, 11)
        Returned as they are where they are consistent.

    Returns
    -------
    ConsistentLinks

    """
    if are_consistent(parameters):
        return ConsistentLinks(parameters, np.zeros(len(parameters)))
    rods = _rods(chain, parameters)
    states = _states(chain)
    directions = _directions(chain, parameters, rods, states)
    problem = _Divergence(parameters, rods, directions)
    at = np.linalg.solve(directions.vectors, (rods - parameters).ravel())
    exact = _same_torques(problem, at, directions.gains == 0.0)
    if exact is not None:
        return ConsistentLinks(problem.parameters(exact), np.zeros(len(parameters)))
    for relaxation in RELAXATIONS:
        at = problem.minimise(at, directions.gains**2 / relaxation)
    found = problem.parameters(at)
    return ConsistentLinks(found, _torque_change(chain, parameters, found, states))


def _same_torques(problem: _Divergence, at: Array, free: BoolArray) -> Array | None:
    """Drive the coordinates that change torques to zero (augmented Lagrangian), where possible."""
    multipliers, penalty = np.zeros(len(at)), np.where(free, 0.0, 1.0)
    for _ in range(MULTIPLIER_STEPS):
        at = problem.minimise(at, penalty, multipliers)
        exact = np.where(free, at, 0.0)
        if problem.is_inside(exact):
            return problem.minimise(exact, np.where(free, 0.0, np.inf))
        multipliers = multipliers + penalty * at
        penalty = 3.0 * penalty
    return None


def _rods(chain: Chain, parameters: Array) -> Array:
    """Return uniform rods from each joint to the next, with weights as those of the arm."""
    n = len(parameters)
    ends = np.zeros((n, 3))
    ends[:-1] = chain.translations[1:]
    lengths = np.maximum(np.linalg.norm(ends, axis=1), SHORTEST)
    mass = max(np.abs(parameters[:, 1:4]).sum() / lengths.sum(), 1e-3)
    pseudo = np.zeros((n, 4, 4))
    spread = RADIUS**2 / 4.0 * np.eye(3)
    pseudo[:, :3, :3] = mass * (spread + np.einsum('ia,ib->iab', ends, ends) / 3.0)
    pseudo[:, :3, 3] = pseudo[:, 3, :3] = 0.5 * mass * ends
    pseudo[:, 3, 3] = mass
    rotors = np.full((n, 1), mass * RADIUS**2)
    return np.concatenate([link_parameters(pseudo), rotors], axis=1)


def _states(chain: Chain) -> tuple[Array, Array, Array]:
    n = len(chain.prismatic)
    rng = np.random.default_rng(0)
    shape = (STATES_PER_PARAMETER * LINK_PARAMETERS, n)
    q = np.where(chain.prismatic, 0.3, np.pi) * rng.uniform(-1.0, 1.0, shape)
    return q, rng.standard_normal(shape), 4.0 * rng.standard_normal(shape)


def _directions(
    chain: Chain, parameters: Array, rods: Array, states: tuple[Array, Array, Array]
) -> Directions:
    regressor = torque_regressor(_contiguous(chain), *states)
    torques = regressor @ parameters.ravel()
    scale = np.sqrt(np.square(torques).mean(axis=0))
    relative = regressor / np.where(scale > 0.0, scale, 1.0)[:, None]
    units = np.repeat(rods[:, :1], LINK_PARAMETERS, axis=1) * _lengths()
    scaled = relative.reshape(-1, units.size) * units.ravel()
    _, gains, vectors = np.linalg.svd(scaled / np.sqrt(len(torques)), full_matrices=False)
    gains = np.where(gains > UNIDENTIFIED * gains[0], gains, 0.0)
    return Directions(units.ravel()[:, None] * vectors.T, gains)


def _lengths() -> Array:
    """Return the units of the parameters of a link of unit mass that is 0.1 m long."""
    return np.repeat([1.0, SHORTEST, SHORTEST**2], [1, 3, 7])


def _torque_change(
    chain: Chain, before: Array, after: Array, states: tuple[Array, Array, Array]
) -> Array:
    regressor = torque_regressor(_contiguous(chain), *states)
    torque, change = regressor @ before.ravel(), regressor @ (after - before).ravel()
    sizes = np.square(torque).mean(axis=0)
    return np.sqrt(np.square(change).mean(axis=0) / np.where(sizes > 0.0, sizes, 1.0))


def _contiguous(chain: Chain) -> Chain:
    rotations, translations = (np.ascontiguousarray(x) for x in chain[:2])
    return chain._replace(rotations=rotations, translations=translations)


class _Divergence:
    """Divergence of the links from the rods, and a penalty on what changes torques."""

    def __init__(self, parameters: Array, rods: Array, directions: Directions) -> None:
        n = len(parameters)
        self._parameters = parameters
        self._vectors = directions.vectors
        changes = directions.vectors.T.reshape(-1, n, LINK_PARAMETERS)
        inverse = np.linalg.inv(np.linalg.cholesky(pseudo_inertia(rods)))
        self._whiten = inverse
        self._at = self._blocks(parameters)
        self._changes = self._blocks(changes)
        self._rotors, self._rotor_changes = (
            x[..., ROTOR] / rods[:, ROTOR] for x in (parameters, changes)
        )
        # the divergence's linear part: the traces
        traces = np.trace(self._changes, axis1=-2, axis2=-1) + self._rotor_changes
        self._linear = traces.sum(axis=1)

    def parameters(self, at: Array) -> Array:
        """Return the parameters at given coordinates, shape (n, 11)."""
        return self._parameters + (self._vectors @ at).reshape(-1, LINK_PARAMETERS)

    def is_inside(self, at: Array) -> bool:
        """Whether the links at given coordinates can exist."""
        return self._value(at, np.zeros(len(at)), np.zeros(len(at))) < np.inf

    def minimise(self, at: Array, penalty: Array, multipliers: Array | None = None) -> Array:
        """Descend by Newton's method from a point inside; infinite penalties keep coordinates."""
        free = np.isfinite(penalty)
        weights = np.where(free, penalty, 0.0)
        slope = np.zeros(len(at)) if multipliers is None else multipliers
        value = self._value(at, weights, slope)
        for _ in range(ITERATIONS):
            gradient, hessian = self._derivatives(at, weights, slope)
            step = np.zeros(len(at))
            step[free] = newton_step(hessian[np.ix_(free, free)], gradient[free])
            decrease = float(-gradient @ step)
            if decrease < CONVERGED * max(1.0, abs(value)):
                break
            at, value = self._search(at, step, value, decrease, weights, slope)
        return at

    def _search(
        self,
        at: Array,
        step: Array,
        value: float,
        decrease: float,
        weights: Array,
        slope: Array,
    ) -> tuple[Array, float]:
        """Halve a step until it stays inside and gains what its slope promises."""
        length, tried = 1.0, np.inf
        while length > 1e-12:
            tried = self._value(at + length * step, weights, slope)
            if tried <= value - 0.1 * length * decrease:
                return at + length * step, tried
            length *= 0.5
        return at, value

    def _blocks(self, parameters: Array) -> Array:
        whiten = self._whiten
        return np.asarray(whiten @ pseudo_inertia(parameters) @ whiten.transpose(0, 2, 1))

    def _links(self, at: Array) -> tuple[Array, Array]:
        blocks = self._at + np.tensordot(at, self._changes, axes=1)
        return blocks, self._rotors + at @ self._rotor_changes

    def _value(self, at: Array, weights: Array, slope: Array) -> float:
        blocks, rotors = self._links(at)
        try:
            diagonals = np.diagonal(np.linalg.cholesky(blocks), axis1=-2, axis2=-1)
        except np.linalg.LinAlgError:
            return np.inf
        if rotors.min() <= 0.0:
            return np.inf
        barrier = 2.0 * np.log(diagonals).sum() + np.log(rotors).sum()
        return float(0.5 * weights @ at**2 + (self._linear + slope) @ at - barrier)

    def _derivatives(self, at: Array, weights: Array, slope: Array) -> tuple[Array, Array]:
        blocks, rotors = self._links(at)
        lower = np.linalg.cholesky(blocks)
        inverse = np.linalg.inv(lower)
        inner = inverse @ self._changes @ inverse.transpose(0, 2, 1)
        share = self._rotor_changes / rotors
        gradient = weights * at + self._linear + slope
        gradient -= np.trace(inner, axis1=-2, axis2=-1).sum(axis=1) + share.sum(axis=1)
        flat = np.concatenate([inner.reshape(len(at), -1), share], axis=1)
        return gradient, np.diag(weights) + flat @ flat.T


def newton_step(hessian: Array, gradient: Array) -> Array:
    """Solve in units of the diagonal, with as much of it added as rounding takes away."""
    scale = np.sqrt(np.diagonal(hessian))
    scaled = hessian / np.multiply.outer(scale, scale) + JITTER * np.eye(len(hessian))
    return np.asarray(-np.linalg.solve(scaled, gradient / scale) / scale)
