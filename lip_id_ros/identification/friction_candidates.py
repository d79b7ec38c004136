"""The friction terms that are on offer for the drives of an arm (maths.md, section 12)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import cutoffs_hz, Dataset
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.friction.conservative_terms import position_curve, ripple, spring, velocity_curve
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.terms import (
    asymmetric,
    coulomb,
    dahl,
    load_coulomb,
    load_torque,
    load_viscous,
    position_coulomb,
    presliding,
    quadratic,
    saturating,
    shared_friction,
    stribeck,
    Term,
    viscous,
)
from lip_id_ros.identification.left_out import LEAST_ERRORS, LEAST_GAIN
from lip_id_ros.joint_types import DISPLACEMENTS, REVOLUTE

RISE_PERIODS = 0.194
"""
Rise time of the low-pass of preprocessing in periods of its cut-off: the one for which
tanh(t / rise_time) is nearest to its response to a step from -1 to 1.
"""


def rise_time(dataset: Dataset) -> float:
    """Return the rise time of the low-pass of a data set [s]; 0 where none is known."""
    known = [cutoff for cutoff in cutoffs_hz(dataset.provenance) if cutoff and cutoff > 0.0]
    return RISE_PERIODS / max(known) if known else 0.0


LEAST_ACCELERATION = 1e-6
"""Of a joint that does not move [rad/s^2 or m/s^2]."""

RARE_GAIN = 0.5
"""
Least relative decrease of left-out mean squares, summed over joints, for terms that few drives
have, or for which the links' parameters can stand in.
"""

SMALL_GAIN, SMALL_ERRORS = float(-np.log(0.9)), 1.0
"""
The same for memory and for curves over the position, and their least gain in standard errors: a
tenth of the left-out squares of a joint.
"""

VELOCITY_GAIN, VELOCITY_ERRORS = float(-np.log(0.8)), 2.0
"""The same for curves over the velocity, which may stand in for friction that has a name."""

CURVE_STEPS, OUTSIDE = (8, 16), 0.002
"""Numbers of their steps, and the share of the samples beyond them at either end."""

SLOW = 2
"""Largest harmonic of a position that may stand in for a spring between two points."""

COUPLING_GAIN = float(np.log(4.0))
"""
The same for efforts of coupled motors, which the error of a joint has to halve for: with places
of the joints that are not exact, the torques of neighbours explain a little everywhere.
"""


@dataclass(frozen=True)
class Candidate:
    """
    Terms that are selected together where they predict left-out blocks better by `least_gain`.

    Errors are standard errors over the blocks.
    """

    terms: tuple[DriveTerm, ...]
    least_gain: float = field(default=LEAST_GAIN, compare=False)
    least_errors: float = field(default=LEAST_ERRORS, compare=False)

    @property
    def comes_last(self) -> bool:
        """Whether it may stand in for all the others: a curve over the velocity."""
        return self.terms[0].term.kind is velocity_curve


def plain_candidates(widths: Array) -> list[Candidate]:
    """Return viscous and Coulomb friction and an offset for every joint."""
    return [Candidate((term,)) for term in plain_friction(len(widths), widths).terms]


def saturating_candidates(widths: Array) -> list[Candidate]:
    """Return viscous friction that saturates for every joint."""
    terms = (saturating(float(width)) for width in widths)
    return [Candidate((DriveTerm(Drive.of_joint(j), term),)) for j, term in enumerate(terms)]


def presliding_candidates(widths: Array, dataset: Dataset) -> list[Candidate]:
    """Return pre-sliding friction for every joint."""
    sizes = zip(widths, _usual_acceleration(dataset), strict=True)
    terms = (presliding(float(width), float(size)) for width, size in sizes)
    return [Candidate((DriveTerm(Drive.of_joint(j), term),)) for j, term in enumerate(terms)]


def _usual_acceleration(dataset: Dataset) -> Array:
    """Return root mean square accelerations, shape (n,) [rad/s^2 or m/s^2]."""
    return np.maximum(np.sqrt(np.mean(dataset.ddq**2, axis=0)), LEAST_ACCELERATION)


def ripple_candidates(harmonics: Mapping[int, int]) -> list[Candidate]:
    """Return the torque that ripples so many times in a turn, for some of the joints."""
    drives = ((Drive.of_joint(joint), ripple(often)) for joint, often in harmonics.items())
    return [Candidate((DriveTerm(*each),), RARE_GAIN) for each in drives]


def candidates(widths: Array, dataset: Dataset) -> list[Candidate]:
    """
    Return the terms on offer beside viscous and Coulomb friction and offsets.

    Widths of smooth signs have shape (n,) [rad/s or m/s]; the data set has states of Dahl's
    friction.
    """
    offers = named_candidates(widths, dataset)
    for joint, width in enumerate(widths.tolist()):
        memories = memory_terms(joint, width)
        offers += [Candidate((term,), SMALL_GAIN, SMALL_ERRORS) for term in memories]
        offers += _curves(dataset, joint)
    return offers


def memory_terms(joint: int, width: float) -> tuple[DriveTerm, ...]:
    """Return friction of a joint that remembers, of all displacements of which states are kept."""
    own = Drive.of_joint(joint)
    return tuple(DriveTerm(own, dahl(width, each)) for each in DISPLACEMENTS)


def named_candidates(widths: Array, dataset: Dataset) -> list[Candidate]:
    """
    Return the terms of a form that the literature gives, without memory.

    Terms that are periodic in a position are on offer where the data set covers the period.
    """
    offers: list[Candidate] = []
    turned = np.ptp(dataset.q, axis=0)
    at_reversals = presliding_candidates(widths, dataset)
    smoothing = rise_time(dataset) * _usual_acceleration(dataset)
    for j, width in enumerate(float(each) for each in widths):
        common: list[Term] = [
            stribeck(width, float(smoothing[j])),
            saturating(width),
            quadratic(),
            load_coulomb(width),
            load_viscous(),
        ]
        rare: list[Term] = [asymmetric(width), spring()]
        if dataset.joint_types[j] == REVOLUTE:
            rare += [ripple(k) for k in (1, 2) if turned[j] > 2.0 * np.pi / k]
            rare += [position_coulomb(width)] if turned[j] > np.pi else []
        own = Drive.of_joint(j)
        offers += [Candidate((DriveTerm(own, term),)) for term in common]
        # either may stand in for the other, so that both are on offer together
        loaded = load_coulomb(width), load_viscous()
        offers.append(Candidate(tuple(DriveTerm(own, term) for term in loaded)))
        offers.append(at_reversals[j])
        offers += [Candidate((DriveTerm(own, term),), RARE_GAIN) for term in rare]
    return offers + _coupled(widths) + _transmitted(widths)


def _curves(dataset: Dataset, joint: int) -> list[Candidate]:
    """Return curves over the position and the velocity of a joint, over the range of most."""
    kinds = (
        (position_curve, dataset.q, (SMALL_GAIN, SMALL_ERRORS)),
        (velocity_curve, dataset.dq, (VELOCITY_GAIN, VELOCITY_ERRORS)),
    )
    offers = []
    for kind, values, least in kinds:
        low, high = np.quantile(values[:, joint], (OUTSIDE, 1.0 - OUTSIDE)).tolist()
        if high > low:
            terms = (DriveTerm(Drive.of_joint(joint), kind(low, high, k)) for k in CURVE_STEPS)
            offers += [Candidate((term,), *least) for term in terms]
    return offers


def _coupled(widths: Array) -> list[Candidate]:
    """Return friction of motors that turn with two neighbouring joints, as in coupled wrists."""
    offers = []
    for j in range(1, len(widths)):
        for ratio in (1.0, -1.0):
            drive = Drive((j, j - 1), (1.0, ratio))
            terms = (viscous(), coulomb(float(np.hypot(widths[j], widths[j - 1]))))
            offers.append(Candidate(tuple(DriveTerm(drive, term) for term in terms), RARE_GAIN))
    return offers


def _transmitted(widths: Array) -> list[Candidate]:
    """Return torques of neighbouring joints in the effort of a motor, alone and with friction."""
    offers = []
    for joint, width in enumerate(float(each) for each in widths):
        for to in (joint - 1, joint + 1):
            if not 0 <= to < len(widths):
                continue
            drive = Drive.transmitted(joint, to)
            terms = DriveTerm(drive, load_torque()), DriveTerm(drive, shared_friction(width))
            offers += [Candidate(terms[:1], COUPLING_GAIN), Candidate(terms, COUPLING_GAIN)]
    return offers


def lever_candidate(joint: int, lever: Term, stand_ins: Sequence[Candidate]) -> Candidate:
    """Return a spring between two points, which takes the place of other terms of its joint."""
    few = sum(part.size for each in stand_ins for part in each.terms) <= len(lever.lower)
    least = SMALL_GAIN if few else LEAST_GAIN
    return Candidate((DriveTerm(Drive.of_joint(joint), lever),), least, SMALL_ERRORS)


def stands_for_lever(candidate: Candidate, joint: int) -> bool:
    """Return whether terms may stand in for a spring between two points of a joint's links."""
    part = candidate.terms[0]
    slow = part.term.kind is ripple and part.term.parameters['harmonic'] <= SLOW
    own = part.drive == Drive.of_joint(joint)
    return own and (slow or part.term.kind in (spring, position_curve))


def has_width(candidate: Candidate) -> bool:
    """Return whether a term of a single joint's drive has a smooth sign."""
    first = candidate.terms[0]
    return len(first.drive.joints) == 1 and 'width' in first.term.parameters


def with_width(candidates: Sequence[Candidate], joint: int, width: float) -> Candidate:
    """Return all such terms of a joint together, with another width."""
    drive = Drive.of_joint(joint)
    terms = [each.terms[0].term for each in candidates if each.terms[0].drive == drive]
    wide = [term.changed(width=width) for term in terms]
    return Candidate(tuple(DriveTerm(drive, term) for term in wide))
