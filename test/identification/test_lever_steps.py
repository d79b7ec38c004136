"""Springs between two points are fitted together with placements, links and friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import springs
from benchmarks._drives import random_arm
from lip_id_ros.friction.conservative_terms import LeverSpring
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, ROUND
from lip_id_ros.identification.lever_steps import with_lever_steps
from lip_id_ros.identification.sample_selection import remembering

pytestmark = pytest.mark.slow

SAMPLES = 400


def fitted(kind: str) -> tuple[ArmFitter, ArmFit]:
    """Return a fit to a simulated arm from where its joints are."""
    fitter = ArmFitter(remembering(springs.simulated(kind, 0, 0)))
    chain = random_arm(springs.N_JOINTS, 0).chain
    start = fitter.best_start([chain], fitter.selected(chain))
    return fitter, fitter.refined(fitter.some(SAMPLES), start, ROUND)


def spring_of(fit: ArmFit) -> LeverSpring:
    (found,) = (p.term for p in fit.friction.basis.terms if isinstance(p.term, LeverSpring))
    return found


def with_spring(fit: ArmFit, spring: LeverSpring) -> ArmFit:
    terms = (
        replace(part, term=spring) if isinstance(part.term, LeverSpring) else part
        for part in fit.friction.basis.terms
    )
    basis = replace(fit.friction.basis, terms=tuple(terms))
    return replace(fit, friction=replace(fit.friction, basis=basis))


def test_steps_lead_back_to_the_shape() -> None:
    fitter, fit = fitted('gas')
    found = spring_of(fit)
    wrong = LeverSpring(found.eccentricity + 0.08, found.dead_centre - 0.05)
    start = fitter.refined(fitter.some(SAMPLES), with_spring(fit, wrong), ROUND)
    stepped = with_lever_steps(fitter, start)
    assert stepped.score < start.score
    np.testing.assert_allclose(spring_of(stepped).eccentricity, found.eccentricity, atol=0.02)
    np.testing.assert_allclose(spring_of(stepped).dead_centre, found.dead_centre, atol=0.02)


def test_a_fit_without_springs_stays_as_it_is() -> None:
    fitter, fit = fitted('none')
    assert with_lever_steps(fitter, fit) is fit
