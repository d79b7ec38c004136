"""Friction of an arm: terms of its drives with their coefficients (maths.md, section 12)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError, ShapeError
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.compiled import CompiledFriction, load_slopes
from lip_id_ros.friction.conservative_terms import lever_spring
from lip_id_ros.friction.drives import Drive, DriveTerm, LARGEST
from lip_id_ros.friction.primitives import Primitive
from lip_id_ros.friction.terms import coulomb, dahl, load_torque
from lip_id_ros.joint_types import JointHistory, UNKNOWN

WIDTH_STD, ECCENTRICITY_STD, CENTRE_STD = 1.0, 0.3, 0.5
"""
Deviations a priori: of the logarithm of a width, of the eccentricity and the dead centre of a
lever [rad].
"""


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
            if part.term.kind is coulomb:
                out += [WIDTH_STD * own[0]]
            elif part.term.kind is lever_spring:
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
            if part.term.kind is load_torque:
                coefficient = self.coefficients[place.start]
                for joint, share in part.drive.efforts:
                    out[..., joint] += share * coefficient * torque[..., part.drive.joints[0]]
        return out

    def torque(
        self, q: Array, dq: Array, ddq: Array, load: Array, history: JointHistory = UNKNOWN
    ) -> Array:
        """Return friction torques (N, n) [N m or N]; arguments as for `FrictionBasis.values`."""
        values = self.basis.values(q, dq, ddq, load, history)
        return np.asarray((values * self.coefficients) @ self.basis.compiled.shares)

    def load_slopes(
        self, q: Array, dq: Array, ddq: Array, load: Array, history: JointHistory = UNKNOWN
    ) -> Array:
        """Differentiate the torques by the loads: of joint i by load j, shape (N, n, n)."""
        basis = self.basis
        states = basis.states(q, dq, ddq, load, history.sign)
        loaded = np.flatnonzero(basis.is_loaded)
        return np.asarray(load_slopes(basis.compiled, loaded, self.coefficients, *states))

    @cached_property
    def compiled(self) -> CompiledFriction:
        """The friction in compiled form; terms with coefficients of zero cost nothing."""
        drives: dict[Drive, dict[Primitive, float]] = defaultdict(lambda: defaultdict(float))
        for part, place in zip(self.basis.terms, self.basis.slices, strict=True):
            columns = zip(part.term.columns, self.coefficients[place], strict=True)
            for column, coefficient in columns:
                for factor, primitive in column:
                    if coefficient != 0.0:
                        drives[part.drive][primitive] += factor * coefficient
        # primitives of one width follow each other
        columns_of = [
            (drive, tuple((factor, primitive) for primitive, factor in sorted(sums.items())))
            for drive, sums in drives.items()
        ]
        return CompiledFriction.of(columns_of, self.n_joints, self.basis.rise_time)

    @cached_property
    def remembering(self) -> FrictionModel | None:
        """The terms that depend on the history, None if there are none."""
        kept = [part.term.kind is dahl for part in self.basis.terms]
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
