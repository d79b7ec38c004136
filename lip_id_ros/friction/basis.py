"""The terms of the drives of an arm and their features (maths.md, section 12)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.friction.compiled import CompiledFriction, values_of_drives
from lip_id_ros.friction.conservative_terms import lever_shape, lever_spring
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.primitives import LOAD
from lip_id_ros.friction.terms import coulomb, dahl, offset, sign_width, Term, viscous
from lip_id_ros.joint_types import DISPLACEMENTS, JointHistory, UNKNOWN

LEAST_SMOOTHING = 1e-12

SHAPES: dict[Callable[..., Term], Callable[..., Term]] = {
    coulomb: sign_width,
    lever_spring: lever_shape,
}
"""
Terms of the slopes by parameters that do not enter the torque linearly, as those of a width.

A term and that of its slopes have the same parameters.
"""


@dataclass(frozen=True)
class FrictionBasis:
    """
    The terms of all drives, without coefficients.

    `rise_time` [s] is that of the torques' low-pass, whose response to a step from -1 to 1 is
    nearly tanh(t / rise_time); 0 for none.
    """

    n_joints: int
    terms: tuple[DriveTerm, ...]
    rise_time: float = 0.0

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return sum(each.size for each in self.terms)

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """The coefficients of every term."""
        ends = np.cumsum([0, *(each.size for each in self.terms)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    def with_shapes(self) -> FrictionBasis:
        """Return the basis with widths of signs and shapes of levers as terms at the end."""
        shapes = (
            DriveTerm(each.drive, SHAPES[each.term.kind](**each.term.parameters))
            for each in self.terms
            if each.term.kind in SHAPES
        )
        return replace(self, terms=(*self.terms, *shapes))

    @property
    def lower(self) -> Array:
        """Lower bounds of the coefficients, shape (K,)."""
        return np.array([bound for each in self.terms for bound in each.term.lower])

    @property
    def prior_shares(self) -> Array:
        """Prior deviations of the coefficients, as shares of those of usual size, (K,)."""
        return np.array([e.term.prior_share for e in self.terms for _ in range(e.size)])

    @property
    def is_positive(self) -> BoolArray:
        """Which coefficients must be positive, shape (K,)."""
        return np.asarray(self.lower >= 0.0)

    @property
    def is_loaded(self) -> BoolArray:
        """Which features depend on the load, shape (K,)."""
        columns = [column for each in self.terms for column in each.term.columns]
        return np.array(
            [any(part.loaded or part.shape == LOAD for _, part in column) for column in columns],
            dtype=bool,
        )

    def columns(self) -> tuple[IndexArray, ...]:
        """Return, for every joint, the coefficients that its torque depends on."""
        own: list[list[int]] = [[] for _ in range(self.n_joints)]
        for part, place in zip(self.terms, self.slices, strict=True):
            for joint, _ in part.drive.efforts:
                own[joint].extend(range(place.start, place.stop))
        return tuple(np.array(each, dtype=np.intp) for each in own)

    def discrepancy(self, dq: Array, ddq: Array, sign: Array | None) -> Array:
        """
        Return the difference (N, n) of low-passed signs to those of constant accelerations.

        Zeros without a sign or a low-pass.
        """
        if sign is None or not self.rise_time:
            return np.zeros_like(dq)
        smoothing = np.maximum(self.rise_time * np.abs(ddq), LEAST_SMOOTHING)
        return np.asarray(sign - np.tanh(dq / smoothing))

    @cached_property
    def compiled(self) -> CompiledFriction:
        """The features, each as a drive of its own with a coefficient of 1."""
        columns = [(part.drive, column) for part in self.terms for column in part.term.columns]
        return CompiledFriction.of(columns, self.n_joints, self.rise_time)

    def values(
        self, q: Array, dq: Array, ddq: Array, load: Array, history: JointHistory = UNKNOWN
    ) -> Array:
        """
        Return the features (N, K) at the drives, of which efforts have shares (K, n).

        The load (N, n) is what drives transmit to the links [N m or N]; the history, as far as
        known.
        """
        states = self.states(q, dq, ddq, load, history.sign)
        out = np.asarray(values_of_drives(self.compiled, *states))
        if history.dahl is not None:
            signs, own, joints, kept = self.memory
            steady = signs.values(q, dq, ddq, load, JointHistory(history.sign))
            out[:, own] = history.dahl[:, joints, kept] - steady
        return out

    def states(
        self, q: Array, dq: Array, ddq: Array, load: Array, sign: Array | None
    ) -> tuple[Array, ...]:
        """Return states and loads (N, n), and the discrepancy of features' signs, (N, K)."""
        discrepancy = self.discrepancy(dq, ddq, sign) @ self._signs
        every = (q, dq, ddq, load, discrepancy)
        return tuple(np.ascontiguousarray(x, dtype=np.float64) for x in every)

    @cached_property
    def _signs(self) -> Array:
        """The sign with which a joint turns the drive of a feature alone, (n, K); else zero."""
        signs = np.sign(self.compiled.ratios)
        alone = np.count_nonzero(signs, axis=1) == 1
        return np.asarray((signs * alone[:, None]).T)

    @cached_property
    def memory(self) -> tuple[FrictionBasis, IndexArray, IndexArray, IndexArray]:
        """
        Dahl's friction of drives of one joint.

        The smooth signs of its terms as a basis; their coefficients, their joints, and the places
        of their displacements in `DISPLACEMENTS`.
        """
        signs, rows = [], []
        for part, place in zip(self.terms, self.slices, strict=True):
            if part.term.kind is dahl and len(part.drive.joints) == 1:
                known, joint = part.term.parameters, part.drive.joints[0]
                signs.append(DriveTerm(part.drive, coulomb(known['width'])))
                rows.append((place.start, joint, DISPLACEMENTS.index(known['displacement'])))
        own, joints, kept = np.array(rows, dtype=np.intp).reshape(-1, 3).T
        return replace(self, terms=tuple(signs)), own, joints, kept

    def features(
        self, q: Array, dq: Array, ddq: Array, load: Array, history: JointHistory = UNKNOWN
    ) -> Array:
        """Return the features (N, n, K) of all torques; arguments as for `values`."""
        values = self.values(q, dq, ddq, load, history)
        return np.asarray(values[:, None] * np.ascontiguousarray(self.compiled.shares.T))

    def features_of_joints(
        self, q: Array, dq: Array, ddq: Array, load: Array, history: JointHistory = UNKNOWN
    ) -> tuple[Array, ...]:
        """Return features (N, k_i) of every joint's torque, in the order of `columns`."""
        values, shares = self.values(q, dq, ddq, load, history), self.compiled.shares
        return tuple(values[:, own] * shares[own, i] for i, own in enumerate(self.columns()))


def plain_friction(n_joints: int, widths: Array) -> FrictionBasis:
    """Return viscous and Coulomb friction and an offset for every joint, given sign widths."""
    terms = tuple(
        DriveTerm(Drive.of_joint(joint), term)
        for joint in range(n_joints)
        for term in (viscous(), coulomb(float(widths[joint])), offset())
    )
    return FrictionBasis(n_joints, terms)
