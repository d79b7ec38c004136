"""Shapes of springs between two points, fitted together with all else of an arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.conservative_terms import ECCENTRICITIES, lever_shape, lever_spring
from lip_id_ros.friction.drives import DriveTerm
from lip_id_ros.friction.terms import Term
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, MOST_SAMPLES, ROUND

ROUNDS, SHARES = 8, (1.0, 0.3, 0.1)
"""Most steps, and the shares of one that are tried until the likelihood rises."""

LEAST_GAIN = 1e-3
"""Least gain of a step in log likelihood per sample that is worth another one."""


def with_lever_steps(fitter: ArmFitter, fit: ArmFit) -> ArmFit:
    """
    Return a fit whose springs have the shapes that explain most.

    Without springs the same. A step is that of Gauss and Newton in all parameters together. It is
    taken only where the fit around it is better.
    """
    if not _levers(fit.friction.basis):
        return fit
    some = fitter.some(MOST_SAMPLES)
    for _ in range(ROUNDS):
        step = _step(fitter, some, fit)
        tried = (fitter.refined(some, _moved(fit, share * step), ROUND) for share in SHARES)
        better = next((each for each in tried if each.score < fit.score - LEAST_GAIN), None)
        if better is None:
            break
        fit = better
    return fit


def _levers(basis: FrictionBasis) -> list[tuple[int, DriveTerm]]:
    """Return the springs between two points: number of the first coefficient, and term."""
    parts = zip(basis.terms, basis.slices, strict=True)
    return [(place.start, part) for part, place in parts if part.term.kind is lever_spring]


def _step(fitter: ArmFitter, some: Dataset, fit: ArmFit) -> Array:
    """Return the step of eccentricity and dead centre of every spring, shape (L, 2)."""
    basis, levers = fit.friction.basis, _levers(fit.friction.basis)
    shapes = tuple(
        DriveTerm(part.drive, lever_shape(**part.term.parameters)) for _, part in levers
    )
    freed = replace(basis, terms=(*basis.terms, *shapes))
    size = freed.size - basis.size
    friction = replace(
        fit.friction, basis=freed, coefficients=np.pad(fit.friction.coefficients, (0, size))
    )
    state = replace(fit.state, friction=np.pad(fit.state.friction, (0, size)))
    found = fitter.refined(some, replace(fit, friction=friction, state=state), ROUND)
    change = found.friction.coefficients[basis.size :].reshape(-1, 3)
    first = np.array([k for k, *_ in levers])
    force, stiffness = (found.friction.coefficients[first + i] for i in (0, 1))
    square = np.maximum(force**2 + stiffness**2, 1e-300)
    by_eccentricity = change[:, 0] * force / np.maximum(force**2, 1e-6 * square)
    by_centre = (change[:, 1] * force + change[:, 2] * stiffness) / square
    return np.column_stack([by_eccentricity, by_centre])


def _moved(fit: ArmFit, step: Array) -> ArmFit:
    """Return a fit whose springs have other shapes, and the same coefficients."""
    steps = iter(step.tolist())
    terms = (
        replace(part, term=_reshaped(part.term, *next(steps)))
        if part.term.kind is lever_spring
        else part
        for part in fit.friction.basis.terms
    )
    basis = replace(fit.friction.basis, terms=tuple(terms))
    return replace(fit, friction=replace(fit.friction, basis=basis))


def _reshaped(term: Term, by_eccentricity: float, by_centre: float) -> Term:
    eccentricity, dead_centre = term.parameters['eccentricity'], term.parameters['dead_centre']
    eccentricity = float(np.clip(eccentricity + by_eccentricity, *ECCENTRICITIES))
    return term.changed(eccentricity=eccentricity, dead_centre=dead_centre + by_centre)
