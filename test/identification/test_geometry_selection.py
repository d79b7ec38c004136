"""Twists and lengths selected on a simulated Panda, whose last joint bears hardly a load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from benchmarks._panda import run_pair
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter
from lip_id_ros.identification.friction_candidates import named_candidates
from lip_id_ros.identification.friction_selection import Offer
from lip_id_ros.identification.geometry_selection import select_geometry
from lip_id_ros.rigid_body import Chain
from lip_id_ros.simulation import panda

pinocchio = pytest.importorskip('pinocchio')
pytestmark = pytest.mark.slow
QUARTER = 0.5 * np.pi


def true_chain() -> Chain:
    placements = list(panda(7)._model.jointPlacements)[1:]
    return Chain(
        np.stack([each.rotation for each in placements]),
        np.stack([each.translation for each in placements]),
        np.zeros(7, dtype=bool),
        np.array([0.0, 0.0, -9.80665]),
    )


@pytest.fixture(scope='module')
def selected() -> tuple[ArmFitter, ArmFit]:
    fitter, chain = ArmFitter(run_pair(7, seed=3)[0]), true_chain()
    fit = fitter.best_start([chain], fitter.selected(chain))
    return fitter, select_geometry(fitter, fitter.refined(fitter.dataset, fit))


def test_the_selected_fit_has_converged(selected: tuple[ArmFitter, ArmFit]) -> None:
    """Trials stop early, the fit that is returned does not."""
    fitter, fit = selected
    assert fit.score - fitter.refined(fitter.dataset, fit).score < 1e-3


def noisy(seed: int) -> Dataset:
    """Return 25 s of torques with slow errors of a tenth of each."""
    dataset, rng = run_pair(7, seed)[0], np.random.default_rng(seed)
    errors = gaussian_filter1d(rng.normal(size=dataset.tau.shape), 2.0, axis=0)
    tau = dataset.tau + 0.1 * dataset.tau.std(axis=0) / errors.std(axis=0) * errors
    return replace(dataset, tau=tau).select(np.arange(250))


def test_what_right_geometry_gains_does_not_pay_for_wrong_geometry() -> None:
    """Right angles predict better by more than axes lose that are wrongly taken to meet."""
    fitter, chain = ArmFitter(noisy(4)), true_chain()
    # a curve that slow errors call for is no matter of the geometry
    fit = fitter.best_start([chain], fitter.selected(chain, Offer(named_candidates, levers=True)))
    geometry = select_geometry(fitter, fitter.refined(fitter.dataset, fit)).geometry
    np.testing.assert_array_equal(geometry.twists[1:6], QUARTER)
    np.testing.assert_array_equal(geometry.meets[1:5], [True, True, False, False])
