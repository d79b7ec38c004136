"""
An arm and what is attached to it, fitted together to torques with and without it.

A light last link hardly shows where its joint is, and a payload makes that matter: the arm is
free, and its model's torques at random states stand for the recordings that it is from.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.identification.arm_coordinates import moved_chain
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import (
    BODY,
    link_parameter_jacobian,
    link_parameters,
    log_cholesky,
    moved,
    scale_of,
)
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

MASS, LENGTH = 10.0, 0.3
"""Prior standard deviations of a payload's mass [kg] and of where it is [m]."""

BODY_PRECISION = 1.0 / (MASS * np.repeat([1.0, LENGTH, LENGTH**2], [1, 3, 6]))
LEAST_SCALED = 1e-12
"""Least eigenvalue of the scaled pseudo-inertias of the links that a fit starts from."""

FRICTION_PRECISION = 1.0
"""Of the prior on logarithms of friction coefficients, or on other coefficients [N m or N]."""


class WeightedTorques(NamedTuple):
    """Torques at joint states, with their standard deviations; all of shape (N, n)."""

    q: Array
    dq: Array
    ddq: Array
    tau: Array
    std: Array

    @property
    def state(self) -> tuple[Array, Array, Array]:
        """Positions, velocities, accelerations."""
        return self.q, self.dq, self.ddq


@dataclass(frozen=True, eq=False)
class LoadedState:
    """An arm, and the body that is attached to it."""

    arm: ArmPosterior  # without the body
    numbers: Array  # (n, 11), log-Cholesky numbers of its links
    body: Array  # (10,)
    cost: float
    residual: Array  # (m,), of both sets of torques, in deviations


class PayloadProblem:
    """Least squares over placements, log-Cholesky numbers, friction and body, in this order."""

    def __init__(self, arm: ArmPosterior, bare: WeightedTorques, loaded: WeightedTorques) -> None:
        self.arm, self.bare, self.loaded = arm, bare, loaded
        self._scale = scale_of(float(arm.links[:, 0].mean()), LENGTH)
        vague = ArmPrior.vague(len(arm.links), self._scale)
        self._prior = replace(vague, chain=arm.chain)
        friction = np.full(arm.friction.basis.size, FRICTION_PRECISION)
        self.precision = np.concatenate([self._prior.precision, friction, BODY_PRECISION])

    @property
    def size(self) -> int:
        """Number of entries of a step, m."""
        return len(self.precision)

    def start(self) -> LoadedState:
        """Return the arm as it is known, with nothing attached."""
        numbers = log_cholesky(self.arm.links, self._scale, LEAST_SCALED)
        return self._evaluated(self.arm, numbers, np.zeros(BODY))

    def evaluated(self, at: LoadedState) -> LoadedState:
        """Return a state with its cost and residual in this problem."""
        return self._evaluated(at.arm, at.numbers, at.body)

    def stepped(self, at: LoadedState, step: Array) -> LoadedState:
        """Return the state that a step leads to."""
        arm, n = at.arm, len(at.numbers)
        placements, links, friction, body = np.split(step, np.cumsum(self._sizes()))
        numbers = moved(at.numbers, links.reshape(n, LINK_PARAMETERS))
        coefficients, positive = arm.friction.coefficients, arm.friction.basis.is_positive
        grown = coefficients * np.exp(np.where(positive, np.clip(friction, -1.0, 1.0), 0.0))
        coefficients = np.where(positive, grown, coefficients + friction)
        moved_arm = replace(
            arm,
            chain=moved_chain(arm.chain, placements),
            links=link_parameters(numbers, self._scale),
            friction=FrictionModel(arm.friction.basis, coefficients),
        )
        return self._evaluated(moved_arm, numbers, at.body + body)

    def normal_equations(self, at: LoadedState) -> tuple[Array, Array]:
        """Return J^T J and J^T r of steps at a state."""
        rows = self.rows(at)
        hessian = rows.T @ rows
        hessian.flat[:: self.size + 1] += self.precision**2
        return hessian, self.precision * self.prior_residual(at) - rows.T @ at.residual

    def rows(self, at: LoadedState) -> Array:
        """Differentiate all torques by a step, in standard deviations, without and with body."""
        out = np.zeros((at.residual.size, self.size))
        last = (DIRECTIONS + LINK_PARAMETERS) * len(at.numbers)
        blocks = self._blocks(at)
        first = 0
        for arm, given in ((at.arm, self.bare), (with_body(at.arm, at.body), self.loaded)):
            rows = out[first : first + given.tau.size]
            first += given.tau.size
            found = arm.jacobian(*given.state).reshape(len(rows), -1)
            found /= given.std.reshape(-1, 1)
            rows[:, :-BODY] = found
            if given is self.loaded:  # the body is part of the last link
                rows[:, -BODY:] = found[:, last - LINK_PARAMETERS : last - 1]
            for place, block in blocks:
                rows[:, place] = found[:, place] @ block
        return out

    def parameter_map(self, at: LoadedState) -> Array:
        """Differentiate the coordinates of `ArmPosterior`, and the body, by a step, (m, m)."""
        out = np.eye(self.size)
        for place, block in self._blocks(at):
            out[place, place] = block
        return out

    def _blocks(self, at: LoadedState) -> list[tuple[slice, Array]]:
        """Return the blocks of `parameter_map` that are not the identity, and where they are."""
        first, blocks = DIRECTIONS * len(at.numbers), []
        for block in link_parameter_jacobian(at.numbers, self._scale):
            blocks.append((slice(first, first + LINK_PARAMETERS), block))
            first += LINK_PARAMETERS
        friction = at.arm.friction
        slopes = np.where(friction.basis.is_positive, friction.coefficients, 1.0)
        return [*blocks, (slice(first, self.size - BODY), np.diag(slopes))]

    def _sizes(self) -> tuple[int, int, int]:
        n = len(self.arm.links)
        return DIRECTIONS * n, LINK_PARAMETERS * n, self.arm.friction.basis.size

    def prior_residual(self, at: LoadedState) -> Array:
        """Return how far a state is from the prior's centre, in standard deviations, (m,)."""
        known, now = self.arm.friction, at.arm.friction.coefficients
        positive = known.basis.is_positive & (known.coefficients > 0.0)
        logarithm = np.log(np.where(positive, now / np.where(positive, known.coefficients, 1), 1))
        friction = np.where(known.basis.is_positive, logarithm, now - known.coefficients)
        arm = self._prior.deviation(at.arm.chain, at.numbers)
        return np.asarray(self.precision * np.concatenate([arm, friction, at.body]))

    def _evaluated(self, arm: ArmPosterior, numbers: Array, body: Array) -> LoadedState:
        arms = (arm, self.bare), (with_body(arm, body), self.loaded)
        with np.errstate(over='ignore', invalid='ignore'):
            parts = [(x.tau - each.torque(*x.state)) / x.std for each, x in arms]
        at = LoadedState(arm, numbers, body, np.inf, np.concatenate([x.ravel() for x in parts]))
        prior = self.prior_residual(at)
        cost = 0.5 * float(at.residual @ at.residual + prior @ prior)
        return replace(at, cost=cost if np.isfinite(cost) else np.inf)


def with_body(arm: ArmPosterior, body: Array) -> ArmPosterior:
    """Return the arm with a body fixed to its last link."""
    links = arm.links.copy()
    links[-1, :BODY] += body
    return replace(arm, links=links)
