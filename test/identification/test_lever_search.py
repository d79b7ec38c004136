"""Springs between two points are found, fitted with the rest, and invented nowhere."""

from __future__ import annotations

from dataclasses import replace

from friction.test_terms import lever_features
from identification import springs
import numpy as np
import pytest

from benchmarks._arms import random_arm
from lip_id_ros.arrays import Array
from lip_id_ros.friction.conservative_terms import lever_spring
from lip_id_ros.friction.terms import Term
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, ROUND
from lip_id_ros.identification.friction_selection import select_friction
from lip_id_ros.identification.lever_search import best_lever, Explained, LeverSearch
from lip_id_ros.identification.lever_steps import with_lever_steps
from lip_id_ros.identification.sample_selection import remembering

LINK_STD = np.tile([5.0, *[2.0] * 3, *[1.0] * 7], (springs.N_JOINTS, 1))


def explained(q: Array, torque: Array, noise: float) -> Explained:
    """Return what gravity and an offset explain of the torque of one joint."""
    rows = np.column_stack([np.cos(q), np.sin(q), np.ones_like(q)])
    columns, weights = [np.arange(3)], np.ones((q.size, 1))
    return Explained([rows], columns, torque[:, None], weights, np.array([noise]), np.ones(3) * 9)


@pytest.mark.parametrize('seed', range(5))
def test_finds_the_shape(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = float(rng.uniform(0.3, 0.8)), float(rng.uniform(-3.0, 3.0))
    q = rng.uniform(-2.0, 2.0, 400)
    clean = lever_features(q, *shape) @ [4.0, -1.0] + 2.0 * np.cos(q) + 0.3
    torque = clean + 1e-4 * rng.standard_normal(q.size)
    found = best_lever(explained(q, torque, 1.0), 0, q)
    np.testing.assert_allclose(found.parameters['eccentricity'], shape[0], atol=0.01)
    np.testing.assert_allclose(found.parameters['dead_centre'], shape[1], atol=0.01)


def test_the_gain_is_that_of_a_plain_fit() -> None:
    """Half the penalised squares with the spring among all parameters, and without."""
    rng = np.random.default_rng(0)
    q, noise = rng.uniform(-2.0, 2.0, 100), 0.1
    given = explained(q, rng.standard_normal(q.size) + np.sin(q), noise)
    features = lever_features(q, 0.5, 0.7)
    size = np.sqrt(np.mean(features**2, axis=0)) / np.std(given.tau)

    def cost(rows: Array, precision: Array) -> float:
        rows = np.vstack([rows / noise, np.diag(precision)])
        right = np.append(given.tau[:, 0] / noise, np.zeros(precision.size))
        found = np.linalg.lstsq(rows, right, rcond=None)[0]
        return 0.5 * float(np.sum((right - rows @ found) ** 2))

    prior = 1.0 / given.prior_std
    without = cost(given.rows[0], prior)
    with_it = cost(np.hstack([given.rows[0], features]), np.append(prior, size))
    search = LeverSearch(given, 0, q)
    np.testing.assert_allclose(search.gain(0.5, 0.7), without - with_it, rtol=1e-9)
    rows = np.hstack([given.rows[0], features]) / noise
    whole = np.vstack([rows, np.diag(np.append(prior, size))])
    right = np.append(given.tau[:, 0] / noise, np.zeros(5))
    residual = (right - whole @ np.linalg.lstsq(whole, right, rcond=None)[0])[: q.size]
    left = noise * np.sqrt(np.mean(residual**2))
    np.testing.assert_allclose(search.left(lever_spring(0.5, 0.7)), left, rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize('kind', springs.KINDS)
def test_selected_where_it_is(kind: str) -> None:
    data = remembering(springs.simulated(kind))
    found = select_friction(data, random_arm(springs.N_JOINTS, 0).chain, LINK_STD)
    names = [[name for name in own if name == 'lever spring'] for own in found.friction.names()]
    expected = kind != 'none'
    assert [len(own) for own in names] == [0, int(expected), 0, 0]


SAMPLES = 400


def fitted() -> tuple[ArmFitter, ArmFit]:
    """Return a fit to a simulated arm with two gas springs, from where its joints are."""
    data = springs.simulated('gas')
    tau = data.tau.copy()
    tau[:, 2] += data.tau[:, 2].std() * springs.spring('gas', 1, data.q[:, 2])
    fitter = ArmFitter(remembering(replace(data, tau=tau)))
    chain = random_arm(springs.N_JOINTS, 0).chain
    start = fitter.best_start([chain], fitter.selected(chain))
    return fitter, fitter.refined(fitter.some(SAMPLES), start, ROUND)


def springs_of(fit: ArmFit) -> list[Term]:
    return [p.term for p in fit.friction.basis.terms if p.term.kind is lever_spring]


def with_springs(fit: ArmFit, shapes: list[Term]) -> ArmFit:
    left = iter(shapes)
    terms = (
        replace(part, term=next(left)) if part.term.kind is lever_spring else part
        for part in fit.friction.basis.terms
    )
    basis = replace(fit.friction.basis, terms=tuple(terms))
    return replace(fit, friction=replace(fit.friction, basis=basis))


@pytest.mark.slow
def test_steps_lead_back_to_the_shapes_of_two_springs() -> None:
    fitter, fit = fitted()
    found = springs_of(fit)
    assert len(found) == 2
    shapes = np.array([list(term.parameters.values()) for term in found])
    wrong = [lever_spring(e + 0.08, centre - 0.05) for e, centre in shapes]
    start = fitter.refined(fitter.some(SAMPLES), with_springs(fit, wrong), ROUND)
    stepped = with_lever_steps(fitter, start)
    assert stepped.score < start.score
    again = [list(term.parameters.values()) for term in springs_of(stepped)]
    np.testing.assert_allclose(again, shapes, atol=0.02)
