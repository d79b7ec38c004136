"""The prior deviations of terms: slopes by differences, and the fixed point of the evidence."""

from __future__ import annotations

from nodes import toy
import numpy as np
import pytest

from benchmarks.shrinkage import Grams, offered_terms, plain_terms, Prior, Samples
from lip_id_ros.identification.arm_prior import link_prior_std
from lip_id_ros.identification.sample_selection import remembering
from lip_id_ros.rigid_body import Chain

pytestmark = pytest.mark.slow


@pytest.fixture(scope='module')
def grams() -> Grams:
    dataset = remembering(toy.dataset())
    turned = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    gravity = np.array([0.0, -9.8, 0.0])
    chain = Chain(np.array([np.eye(3), turned]), np.zeros((2, 3)), dataset.prismatic, gravity)
    widths = np.full(2, 0.05)
    terms = [*plain_terms(widths), *offered_terms(widths, dataset)]
    return Grams(Samples.of(dataset, chain), terms, link_prior_std(dataset), np.ones((600, 2)))


def test_slopes_of_left_out_squares_by_differences(grams: Grams) -> None:
    deviations = np.exp(np.random.default_rng(0).uniform(-3.0, 0.0, grams.plain.deviations.size))
    _, slope = grams.left_out(Prior(deviations, grams.plain.noise_std))
    for k in range(0, deviations.size, 5):
        values = []
        for step in (1e-4, -1e-4):
            moved = deviations * np.exp(step * (np.arange(deviations.size) == k))
            squares, _ = grams.left_out(Prior(moved, grams.plain.noise_std))
            values.append(0.5 * np.log(squares).sum())
        by_differences = (values[0] - values[1]) / 2e-4
        assert slope[k] == pytest.approx(by_differences, rel=1e-3, abs=1e-6)


def test_what_the_evidence_finds_predicts_no_worse_than_plain_friction(grams: Grams) -> None:
    for prior in (grams.evidence(2.0, 3.0), grams.folds()):
        squares, _ = grams.left_out(prior)
        plain, _ = grams.left_out(grams.plain)
        assert np.log(squares).sum() < np.log(plain).sum() + 0.05
