"""Friction of an arm: terms of its drives with their coefficients (maths.md, section 12)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress, pairwise
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.errors import ModelError, ShapeError
from lip_id_ros.friction.conservative_terms import LeverShape, LeverSpring
from lip_id_ros.friction.dahl import Dahl
from lip_id_ros.friction.drives import Drive, DriveTerm, LARGEST, LoadTorque, SignWidth
from lip_id_ros.friction.primitives import LOAD
from lip_id_ros.friction.terms import Coulomb, FrictionTerm, Offset, Viscous
from lip_id_ros.joint_types import JointHistory, UNKNOWN

LEAST_SMOOTHING = 1e-12

WIDTH_STD, ECCENTRICITY_STD, CENTRE_STD = 1.0, 0.3, 0.5
"""
Deviations a priori: of the logarithm of a width, of the eccentricity and the dead centre of a
lever [rad].
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
        shapes = ((each.drive, _shape_of(each.term)) for each in self.terms)
        terms = (DriveTerm(drive, shape) for drive, shape in shapes if shape is not None)
        return replace(self, terms=(*self.terms, *terms))

    @property
    def lower(self) -> Array:
        """Lower bounds of the coefficients, shape (K,)."""
        return np.array([bound for each in self.terms for bound in each.term.lower])

    @property
    def prior_shares(self) -> Array:
        """Prior deviations of the coefficients, as shares of those of usual size, (K,)."""
        shares = [(getattr(each.term, 'prior_share', 1.0), each.size) for each in self.terms]
        return np.array([share for share, size in shares for _ in range(size)])

    @property
    def is_positive(self) -> BoolArray:
        """Which coefficients must be positive, shape (K,)."""
        return np.asarray(self.lower >= 0.0)

    @property
    def is_loaded(self) -> BoolArray:
        """Which features depend on the load, shape (K,)."""
        columns = [column for each in self.terms for column in each.term.columns()]
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

    def features(
        self, q: Array, dq: Array, ddq: Array, load: Array, history: JointHistory = UNKNOWN
    ) -> tuple[Array, ...]:
        """
        Return features (N, k_i) of every joint's torque, in the order of `columns`.

        The load (N, n) is what drives transmit to the links [N m or N]; the history, as far as
        known.
        """
        own: list[list[Array]] = [[np.zeros((len(q), 0))] for _ in range(self.n_joints)]
        discrepancy = self.discrepancy(dq, ddq, history.sign)
        for part in self.terms:
            state = part.drive.state(q, dq, ddq, load, self.rise_time, discrepancy, history.dahl)
            features = part.term.features(state)
            for joint, share in part.drive.efforts:
                own[joint].append(share * features)
        return tuple(np.hstack(each) for each in own)


@dataclass(frozen=True, eq=False)
class FrictionModel:
    """
    Friction that has been learned.

    Coefficients (K,) are in the units of the terms. Raises ShapeError if there is not one
    coefficient per feature, ModelError if one is below its bound: the term would drive the joint.
    """

    basis: FrictionBasis
    coefficients: Array

    def __post_init__(self) -> None:
        """Check the coefficients."""
        if self.coefficients.shape != (self.basis.size,):
            raise ShapeError(
                f'{self.basis.size} friction coefficients were expected, but '
                f'{self.coefficients.shape} came; give one per feature.'
            )
        if not np.all(self.coefficients >= self.basis.lower):
            raise ModelError(
                'friction coefficients that never drive a joint were expected, but some are '
                'negative; fit them with their bounds.'
            )

    def with_shapes(self) -> FrictionModel:
        """Return the same friction in the basis with the shapes of its terms."""
        basis = self.basis.with_shapes()
        return FrictionModel(basis, np.pad(self.coefficients, (0, basis.size - self.basis.size)))

    @property
    def shape_std(self) -> Array:
        """Prior deviations of the coefficients of shapes, as of present coefficients, (W,)."""
        out = []
        for part, place in zip(self.basis.terms, self.basis.slices, strict=True):
            own = self.coefficients[place]
            if isinstance(part.term, Coulomb):
                out += [WIDTH_STD * own[0]]
            elif isinstance(part.term, LeverSpring):
                out += [ECCENTRICITY_STD * own[0], *(CENTRE_STD * own)]
        return np.abs(np.array(out))

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return self.basis.n_joints

    def efforts(self, torque: Array) -> Array:
        """Return the efforts of motors, coupled or not, for torques of joints, shape (..., n)."""
        out = torque.copy()
        for part, place in zip(self.basis.terms, self.basis.slices, strict=True):
            if isinstance(part.term, LoadTorque):
                coefficient = self.coefficients[place.start]
                for joint, share in part.drive.efforts:
                    out[..., joint] += share * coefficient * torque[..., part.drive.joints[0]]
        return out

    def torque(
        self, q: Array, dq: Array, ddq: Array, load: Array, history: JointHistory = UNKNOWN
    ) -> Array:
        """Return friction torques (N, n) [N m or N]; arguments as for `FrictionBasis.features`."""
        out = np.zeros_like(dq)
        features = self.basis.features(q, dq, ddq, load, history)
        for joint, (rows, column) in enumerate(zip(features, self.basis.columns(), strict=True)):
            out[:, joint] = rows @ self.coefficients[column]
        return out

    @cached_property
    def remembering(self) -> FrictionModel | None:
        """The terms that depend on the history, None if there are none."""
        kept = [isinstance(part.term, Dahl) for part in self.basis.terms]
        return self.with_terms(kept) if any(kept) else None

    def with_rise_time(self, rise_time: float) -> FrictionModel:
        """Return the same friction after another low-pass, 0 for none."""
        return FrictionModel(replace(self.basis, rise_time=rise_time), self.coefficients)

    def with_terms(self, kept: Sequence[bool]) -> FrictionModel:
        """Return some of the terms with their coefficients."""
        basis = replace(self.basis, terms=tuple(compress(self.basis.terms, kept)))
        values = [self.coefficients[place] for place in compress(self.basis.slices, kept)]
        return FrictionModel(basis, np.concatenate([np.zeros(0), *values]))

    def names(self) -> tuple[tuple[str, ...], ...]:
        """Return the names of the terms of every joint, in the words of the literature."""
        own: list[list[str]] = [[] for _ in range(self.n_joints)]
        for part in self.basis.terms:
            for joint, _ in part.drive.efforts:
                others = [f'{k + 1}' for k in part.drive.joints if k != joint]
                coupled = f' coupled with joint {" and ".join(others)}' if others else ''
                own[joint].append(part.term.name + coupled)
        return tuple(tuple(each) for each in own)

    def to_json(self) -> dict[str, Any]:
        """Return the friction for a model file."""
        terms = [part.to_json() for part in self.basis.terms]
        values = self.coefficients.tolist()
        return {
            'n_joints': self.n_joints,
            'rise_time': self.basis.rise_time,
            'terms': terms,
            'coefficients': values,
        }

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> FrictionModel:
        """Return the friction that `to_json` gave; raises ModelError if the entry is damaged."""
        try:
            n_joints = int(entry['n_joints'])
            terms = tuple(DriveTerm.from_json(each, n_joints) for each in entry['terms'])
            coefficients = np.array(entry['coefficients'], dtype=np.float64)
            rise_time = float(entry.get('rise_time', 0.0))
            if not 0.0 <= rise_time < np.inf:
                raise ValueError('a rise time that is no time')
            if not (np.abs(coefficients) <= LARGEST).all():
                raise ValueError('coefficients that no friction has')
            return cls(FrictionBasis(n_joints, terms, rise_time), coefficients)
        except (KeyError, TypeError, ValueError, OverflowError, ShapeError) as error:
            raise ModelError(
                f'friction terms with coefficients were expected, but the file is damaged '
                f'({error}); fit the model again.'
            ) from error


def _shape_of(term: FrictionTerm) -> FrictionTerm | None:
    """Return the slopes of a term by what it is not linear in; None where there is nothing."""
    if isinstance(term, Coulomb):
        return SignWidth(term.width)
    if isinstance(term, LeverSpring):
        return LeverShape(term.eccentricity, term.dead_centre)
    return None


def plain_friction(n_joints: int, widths: Array) -> FrictionBasis:
    """Return viscous and Coulomb friction and an offset for every joint, given sign widths."""
    terms = tuple(
        DriveTerm(Drive.of_joint(joint), term)
        for joint in range(n_joints)
        for term in (Viscous(), Coulomb(float(widths[joint])), Offset())
    )
    return FrictionBasis(n_joints, terms)
