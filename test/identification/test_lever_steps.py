"""Springs between two points are fitted together with placements, links and friction."""

from __future__ import annotations

from dataclasses import replace

from identification import springs
import numpy as np
import pytest

from benchmarks._arms import random_arm
from lip_id_ros.friction.conservative_terms import LeverSpring
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, ROUND
from lip_id_ros.identification.lever_steps import with_lever_steps
from lip_id_ros.identification.sample_selection import remembering

pytestmark = pytest.mark.slow

SAMPLES = 400


def fitted(kind: str, others: dict[int, str] | None = None) -> tuple[ArmFitter, ArmFit]:
    """Return a fit to a simulated arm from where its joints are; others have springs too."""
    data = springs.simulated(kind)
    tau = data.tau.copy()
    for seed, (joint, other) in enumerate((others or {}).items(), start=1):
        tau[:, joint] += data.tau[:, joint].std() * springs.spring(other, seed, data.q[:, joint])
    fitter = ArmFitter(remembering(replace(data, tau=tau)))
    chain = random_arm(springs.N_JOINTS, 0).chain
    start = fitter.best_start([chain], fitter.selected(chain))
    return fitter, fitter.refined(fitter.some(SAMPLES), start, ROUND)


def springs_of(fit: ArmFit) -> list[LeverSpring]:
    return [p.term for p in fit.friction.basis.terms if isinstance(p.term, LeverSpring)]


def with_springs(fit: ArmFit, shapes: list[LeverSpring]) -> ArmFit:
    left = iter(shapes)
    terms = (
        replace(part, term=next(left)) if isinstance(part.term, LeverSpring) else part
        for part in fit.friction.basis.terms
    )
    basis = replace(fit.friction.basis, terms=tuple(terms))
    return replace(fit, friction=replace(fit.friction, basis=basis))


@pytest.mark.parametrize('others', [{}, {2: 'gas'}])
def test_steps_lead_back_to_the_shapes(others: dict[int, str]) -> None:
    fitter, fit = fitted('gas', others)
    found = springs_of(fit)
    assert len(found) == 1 + len(others)
    wrong = [LeverSpring(x.eccentricity + 0.08, x.dead_centre - 0.05) for x in found]
    start = fitter.refined(fitter.some(SAMPLES), with_springs(fit, wrong), ROUND)
    stepped = with_lever_steps(fitter, start)
    assert stepped.score < start.score
    for own, expected in zip(springs_of(stepped), found, strict=True):
        np.testing.assert_allclose(own.eccentricity, expected.eccentricity, atol=0.02)
        np.testing.assert_allclose(own.dead_centre, expected.dead_centre, atol=0.02)


def test_a_fit_without_springs_stays_as_it_is() -> None:
    fitter, fit = fitted('none')
    assert with_lever_steps(fitter, fit) is fit
