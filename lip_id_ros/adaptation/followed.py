"""
What of an arm is followed: its links and its friction, with the posterior of the fit as prior.

Torques are linear in both where the joints are, so that a Kalman filter follows them. What changes
is friction: its coefficients take a random walk, links keep what the posterior leaves open.

"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from lip_id_ros.adaptation.kalman import Walk
from lip_id_ros.adaptation.payloads import known_payload
from lip_id_ros.adaptation.possible import PossibleArms
from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.errors import ModelError
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import offset, Term
from lip_id_ros.joint_types import JointHistory, UNKNOWN
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.residual_gp import ResidualGPMean
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.denavit_hartenberg import with_standard_frames
from lip_id_ros.rigid_body.pseudo_inertia import (
    BODY,
    link_parameter_jacobian,
    LinkScale,
    pseudo_inertia,
)
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS, placement_derivatives

STATES = 300
"""Of the training range, at which sizes of torques are measured where a model keeps no states."""

SECONDS = 3600.0

NEARLY = 1.0 - 1e-9
"""Of a bound, at which a number is taken to be there."""

USUAL_CENTRE, UNSURE_EVERY = np.full(3, 0.1), 4
"""Centre of a usual payload in the frame of the last link [m]; every so many states are taken."""


@dataclass(frozen=True)
class WalkSettings:
    """
    How friction changes: an Ornstein-Uhlenbeck process of each coefficient.

    Deviations in the long run: `friction` of a coefficient, as a share of itself, beside `small`
    as a share of the friction of its joint; `offset` of constant torques, as such a share. `hours`
    [h]: after which a coefficient that is not seen has returned to that of the fit by two thirds.
    `most`: largest change that is followed, as a share of the friction of the joint.

    """

    friction: float = 0.5
    small: float = 0.05
    offset: float = 0.2
    hours: float = 3.0
    most: float = 2.5


class FollowedArm:
    """
    Links and friction of a fitted arm as numbers that a filter follows.

    The numbers are the parameters of the links (11 n), then the coefficients of friction (K).
    `active`: those that the posterior has in use, p of them; torques of the others are among
    theirs. ModelError if the model is no arm.

    """

    def __init__(self, model: InverseDynamicsModel, walk: WalkSettings) -> None:
        if model.arm is None:
            raise ModelError(
                'a model with links and friction is needed to follow changes, but this one is a '
                'Gaussian process on energies; fit with the default kernel.'
            )
        self._model, self._settings = model, walk
        self.arm = arm = model.arm
        self.noise = arm.noise
        self._n_links, self._first = arm.links.size, DIRECTIONS * model.n_joints
        self.start = np.concatenate([arm.links.ravel(), arm.friction.coefficients])
        root = arm.covariance_root[self._first : self._first + self.start.size]
        is_friction = np.arange(self.start.size) >= self._n_links
        self.active: IndexArray = np.flatnonzero(root.any(axis=1) | is_friction)
        self._root = root[self.active]
        self._residual_gp = (
            None if model.residual_gp is None else ResidualGPMean(model.residual_gp)
        )
        # torques of joints whose process is in place of links and friction
        self._replaced = (
            np.zeros(model.n_joints, dtype=np.bool_)
            if model.residual_gp is None
            else np.asarray(model.residual_gp.replaces, dtype=np.bool_)
        )

    @property
    def last_body(self) -> slice:
        """The ten numbers of the last link, without its rotor."""
        return slice(self._n_links - LINK_PARAMETERS, self._n_links - 1)

    @cached_property
    def export_frame(self) -> Array:
        """Numbers of a body in the last frame of `lip_id export`, by those here, (10, 10)."""
        links = np.zeros((BODY, *self.arm.links.shape))
        links[:, -1, :BODY] = np.eye(BODY)
        moved = [with_standard_frames(self.arm.chain, each)[1][-1, :BODY] for each in links]
        return np.stack(moved, axis=1)

    @property
    def friction(self) -> slice:
        """The coefficients of friction among all numbers."""
        return slice(self._n_links, self.start.size)

    @property
    def covariance(self) -> Array:
        """Covariance of the active numbers after the fit, shape (p, p)."""
        return np.asarray(self._root @ self._root.T)

    @cached_property
    def walk(self) -> Walk:
        """How friction changes; links do not."""
        links, friction = np.split(self._root, [self._n_used_links])
        # friction by links, as the posterior of the fit has it, and what it leaves open
        slopes = np.linalg.lstsq(links.T, friction.T, rcond=None)[0].T
        left = friction - slopes @ links
        covariance = left @ left.T + np.diag(self._walk_variance)
        return Walk(slopes, covariance, 1.0 / (SECONDS * self._settings.hours))

    @property
    def change_variance(self) -> Array:
        """Variances of changes in the long run of the active numbers, shape (p,)."""
        return np.concatenate([np.zeros(self._n_used_links), self._walk_variance])

    @cached_property
    def _walk_variance(self) -> Array:
        own, start = self._settings, self.arm.friction.coefficients
        is_offset = np.array([term.kind is offset for _, term in self._columns])
        changing = np.hypot(own.friction * start, own.small * self.unit)
        return np.asarray(np.where(is_offset, own.offset * self.unit, changing) ** 2)

    @property
    def _n_used_links(self) -> int:
        """Count of links' parameters among the active numbers; friction comes after them."""
        return len(self._root) - self._walk_variance.size

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest active numbers that are followed, each of shape (p,)."""
        links = np.full(self._n_used_links, np.inf)
        lower, upper = self._bounds
        return np.concatenate([-links, lower]), np.concatenate([links, upper])

    @property
    def _bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coefficients of friction that are followed, each of shape (K,)."""
        start, most = self.arm.friction.coefficients, self._settings.most * self.unit
        return np.maximum(self.arm.friction.basis.lower, start - most), start + most

    @cached_property
    def friction_size(self) -> Array:
        """Root mean square of each joint's friction in the training data, (n,) [N m or N]."""
        torque = self._usual_features @ self.arm.friction.coefficients
        return np.asarray(np.hypot(_rms(torque), self.arm.noise.std))

    @cached_property
    def unit(self) -> Array:
        """Changes of the coefficients that change a torque by `friction_size`, shape (K,)."""
        size = _rms(self._usual_features)
        with np.errstate(divide='ignore'):
            changes = (self.friction_size[:, None] / size).min(axis=0)
        own = np.array([joint for joint, _ in self._columns], dtype=np.intp)
        # friction with a memory is no feature of a single state; it is as large as dry friction
        return np.where(np.isfinite(changes), changes, self.friction_size[own])

    @cached_property
    def speed(self) -> Array:
        """Root mean square velocities of the training data, shape (n,) [rad/s or m/s]."""
        return _rms(self._usual_states[1])

    def friction_at_speed(self) -> Array:
        """
        Return the slopes of friction by its coefficients while one joint moves, (2, n, K).

        Of each joint's own torque, forwards and backwards at `speed`, at the mean position.

        """
        q, _, _ = self._usual_states
        dq = np.concatenate([np.diag(self.speed), -np.diag(self.speed)])
        at, still = np.tile(q.mean(axis=0), (len(dq), 1)), np.zeros_like(dq)
        features = self._features(at, dq, still)
        n = len(self.speed)
        return features[np.arange(2 * n), np.tile(np.arange(n), 2)].reshape(2, n, -1)

    def linearised(
        self, numbers: Array, q: Array, dq: Array, ddq: Array, history: JointHistory = UNKNOWN
    ) -> tuple[Array, Array]:
        """
        Return the torques of N states, (N, n) [N m or N], and their slopes by all numbers.

        `numbers`, shape (11 n + K,), around which torques are linear. `q`, `dq`, `ddq`, shape
        (N, n). The slopes have shape (N, n, 11 n + K).

        """
        _, friction = self._parts(numbers)
        tau, load, regressor, own = self._torque(numbers, q, dq, ddq, history)
        slopes = friction.load_slopes(q, dq, ddq, load, history)
        by_numbers = np.concatenate([regressor + slopes @ regressor, own], axis=2)
        by_numbers[:, self._replaced] = 0.0
        return tau, by_numbers

    def usual_slopes(self, most: int) -> Array:
        """Return the slopes of torques by all numbers at training states, (M, n, 11 n + K)."""
        q, dq, ddq = self._usual_states
        every = slice(None, None, -(-len(q) // most))
        return self.linearised(self.start, q[every], dq[every], ddq[every])[1]

    def fitted_torque(self, q: Array, dq: Array, ddq: Array, history: JointHistory) -> Array:
        """Return the torques of the fit at N states, shape (N, n) [N m or N]."""
        return self._torque(self.start, q, dq, ddq, history)[0]

    def _torque(
        self, numbers: Array, q: Array, dq: Array, ddq: Array, history: JointHistory
    ) -> tuple[Array, Array, Array, Array]:
        """Return torques and loads, (N, n), and features of links and of friction."""
        links, friction = self._parts(numbers)
        regressor = torque_regressor(self.arm.chain, q, dq, ddq)
        load = regressor @ links.ravel()
        own = self.arm.friction.basis.features(q, dq, ddq, load, history)
        tau = load + own @ friction.coefficients
        if self._residual_gp is not None:
            self._residual_gp.add_to(tau, q, dq, ddq)
        return tau, load, regressor, own

    def possible(self, numbers: Array, covariance: Array) -> Array:
        """Return the nearest numbers of an arm that can exist, shape (11 n + K,)."""
        own = np.zeros((self.start.size, self.active.size))
        own[self.active] = _root(covariance)
        return self._possible.nearest(numbers, np.hstack([own, self._free_root]))

    @cached_property
    def _possible(self) -> PossibleArms:
        lower, upper = self._bounds
        return PossibleArms(self.arm.links, lower, upper)

    @cached_property
    def _free_root(self) -> Array:
        """
        Root of the covariance of changes of links that change no torque, (11 n + K, m).

        The posterior keeps the numbers of these where they are, and torques of all others. Links
        are as wide as one log-Cholesky number; torques at training states are as in the fit.

        """
        links = np.arange(self._n_links)
        used = self.active[self.active < self._n_links]
        rest = np.setdiff1d(links, used)
        slopes = self.usual_slopes(STATES)[..., : self._n_links] / self.noise.std[:, None]
        rows = slopes.reshape(-1, self._n_links)
        change = np.zeros((self.start.size, rest.size))
        change[rest] = np.eye(rest.size)
        change[used] = -np.linalg.lstsq(rows[:, used], rows[:, rest], rcond=None)[0]
        factors = np.linalg.cholesky(pseudo_inertia(self.arm.links))
        scale = LinkScale(factors, self.arm.links[:, -1])
        by_numbers = link_parameter_jacobian(np.zeros(self.arm.links.shape), scale)
        wide = block_diag(*by_numbers)[rest]
        torques = rows @ change[links] @ wide
        # a root of (I + torques^T torques)^-1, of links that hardly exist too
        root = np.linalg.inv(np.linalg.qr(np.vstack([torques, np.eye(links.size)]), mode='r'))
        return np.asarray(change @ wide @ root)

    def possible_body(self, link: Array, body: Array, information: Array) -> Array:
        """
        Return the body that a last link can carry with the nearest torques.

        `link`, `body`, shape (10,): the last link without it, and any numbers. `information`,
        shape (10, 10): of the numbers, as torques have it.

        """
        own = self.arm.links[-1:]
        root = np.zeros((LINK_PARAMETERS, LINK_PARAMETERS - 1))
        root[:-1] = np.linalg.inv(np.linalg.cholesky(information)).T
        whole = np.append(link + body, own[0, -1])
        found = PossibleArms(own, np.empty(0), np.empty(0)).nearest(whole, root)
        return body if found is whole else found[:-1] - link

    @cached_property
    def unsure_of_payloads(self) -> float:
        """Share of the squared torques of a body that places of joints, as unsure, leave open."""
        q, dq, ddq = (np.ascontiguousarray(x[::UNSURE_EVERY]) for x in self._usual_states)
        slopes = self.linearised(self.start, q, dq, ddq)[1][..., self.last_body]
        body, loaded = known_payload(1.0, USUAL_CENTRE), self.arm.links.copy()
        loaded[-1, :-1] += body
        bare, more = (
            placement_derivatives(self.arm.chain, links, q, dq, ddq)
            for links in (self.arm.links, loaded)
        )
        std = self.arm.noise.std_at(dq)[..., None]
        open_ = (more - bare).reshape(*slopes.shape[:2], -1) @ self.arm.covariance_root[
            : self._first
        ]
        rows, errors = ((x / std).reshape(-1, x.shape[-1]) for x in (slopes, open_))
        left = errors - rows @ np.linalg.lstsq(rows, errors, rcond=None)[0]
        return float(np.sum(left**2) / np.sum((rows @ body) ** 2))

    def carry(self, body: Array) -> None:
        """Begin with a known body, shape (10,), at the last link of the fit."""
        self.start[self.last_body] = self.arm.links[-1, :-1] + body

    @property
    def fitted(self) -> InverseDynamicsModel:
        """The model of the fit, with the known body at its last link."""
        return self.with_numbers(self.start)

    def with_numbers(self, numbers: Array) -> InverseDynamicsModel:
        """Return the model with other numbers, and the deviations of the fit."""
        links, friction = self._parts(numbers)
        same = np.array_equal(links, self.arm.links)
        if same and np.array_equal(friction.coefficients, self.arm.friction.coefficients):
            return self._model
        return replace(self._model, arm=replace(self.arm, links=links, friction=friction))

    def model(self, numbers: Array, covariance: Array) -> InverseDynamicsModel:
        """Return the model of an arm that can exist."""
        links, friction = self._parts(numbers)
        root = self._with_root(covariance)
        arm = ArmPosterior(self.arm.chain, links, friction, self.arm.noise, root)
        return replace(self._model, arm=arm)

    def beyond(self, numbers: Array) -> BoolArray:
        """Mark the joints whose friction has changed by as much as is followed, shape (n,)."""
        change = np.abs(numbers[self.friction] - self.arm.friction.coefficients)
        marks = np.zeros(len(self.arm.links), dtype=np.bool_)
        at_bound = change >= NEARLY * self._settings.most * self.unit
        for (joint, _), is_there in zip(self._columns, at_bound, strict=True):
            marks[joint] |= is_there
        return marks

    def _parts(self, numbers: Array) -> tuple[Array, FrictionModel]:
        basis = self.arm.friction.basis
        coefficients = np.maximum(numbers[self._n_links :], basis.lower)
        links = numbers[: self._n_links].reshape(-1, LINK_PARAMETERS)
        return links, FrictionModel(basis, coefficients)

    def _with_root(self, covariance: Array) -> Array:
        """Return the root of the covariance of all coordinates; placements keep their own."""
        own = _root(covariance)
        rows, kept = self._first + self.active, self.arm.covariance_root.copy()
        kept[rows] = 0.0
        followed = np.zeros((len(kept), own.shape[1]))
        followed[rows] = own
        return np.asarray(np.linalg.qr(np.hstack([kept, followed]).T, mode='r').T)

    @property
    def _columns(self) -> list[tuple[int, Term]]:
        """The joint and the term of every coefficient."""
        terms = self.arm.friction.basis.terms
        return [(e.drive.efforts[0][0], e.term) for e in terms for _ in range(e.size)]

    @cached_property
    def _usual_states(self) -> tuple[Array, Array, Array]:
        return _usual_states(self._model)

    @cached_property
    def _usual_features(self) -> Array:
        """Features of friction at training states, shape (M, n, K)."""
        return self._features(*self._usual_states)

    def _features(self, q: Array, dq: Array, ddq: Array) -> Array:
        load = torque_regressor(self.arm.chain, q, dq, ddq) @ self.arm.links.ravel()
        return self.arm.friction.basis.features(q, dq, ddq, load)


def _usual_states(model: InverseDynamicsModel) -> tuple[Array, Array, Array]:
    """Return states like those of the training data, each of shape (M, n)."""
    known, n = model.known_states, model.n_joints
    if known is not None:
        rows = known.states * known.scale
    else:
        low, high = (each.ravel() for each in model.training_range)
        rows = np.random.default_rng(0).uniform(low, high, (STATES, 3 * n))
    q, dq, ddq = (np.ascontiguousarray(rows[:, k * n : (k + 1) * n]) for k in range(3))
    return q, dq, ddq


def _root(covariance: Array) -> Array:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(values**2, axis=0)))
