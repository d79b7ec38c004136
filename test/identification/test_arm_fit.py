"""From samples to the posterior of an arm, on simulated arms whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

from gp.arms import dataset_of
from gp.chains import ChainArm, P, R, random_arm
import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import coulomb, load_coulomb, load_torque
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter
from lip_id_ros.identification.arm_prior import links_torque
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.identify import Identified, identify
from lip_id_ros.identification.posterior import (
    around_fit,
    jackknife_root,
    known_of,
    posterior,
    table_deviations,
)
from lip_id_ros.identification.residual_gp_selection import left_out_fits, linearised
from lip_id_ros.identification.sample_selection import covering
from lip_id_ros.identification.solution import coordinates_of, parts_about, system_of
from lip_id_ros.identification.total import FrictionDeviations, gather, Total
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.progress import silent
from lip_id_ros.recording import JointSamples
from lip_id_ros.rigid_body.denavit_hartenberg import table_std
from lip_id_ros.rigid_body.pseudo_inertia import pseudo_inertia
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.simulation import SinusoidTrajectory
from lip_id_ros.simulation.trajectories import MotionLimits

pytestmark = pytest.mark.slow

VISCOUS, COULOMB, NOISE = 0.8, 1.5, 0.02
TYPES = (R, P, R)


def friction(dq: Array) -> Array:
    width = np.where(np.sqrt(np.mean(dq**2, axis=0)) > 1.0, 0.1, 0.015)
    return np.asarray(VISCOUS * dq + COULOMB * np.tanh(dq / width))


@cache
def recorded() -> tuple[ChainArm, Dataset]:
    arm = random_arm(TYPES, seed=2)
    motion = arm.motion(200, seed=0)
    tau = arm.torque(*motion) + friction(motion[1])
    noise = NOISE * np.random.default_rng(1).standard_normal(tau.shape)
    return arm, dataset_of(arm, motion, tau + noise)


def started(fitter: ArmFitter) -> ArmFit:
    placed = ArmSearch(fitter).calibrated(0, silent).placements.chain
    return fitter.best_start([placed], fitter.selected(placed))


@cache
def fitted() -> tuple[ArmFitter, ArmFit]:
    _, dataset = recorded()
    fitter = ArmFitter(dataset)
    calibration = ArmSearch(fitter).calibrated(0, silent)
    selected = fitter.selected(calibration.placements.chain)
    start = fitter.best_start([each.chain for each in calibration.candidates], selected)
    return fitter, fitter.refined(dataset, start)


@cache
def known() -> ArmPosterior:
    return posterior(*fitted())[1]


def test_deviations_of_the_table_are_those_of_the_posterior_and_of_left_out_parts() -> None:
    """Where nothing is selected; those of parts are widened by Student's t of their number."""
    fitter, fit = fitted()
    fit, _, solution, total = posterior(fitter, fit)
    known, noise = known_of(fitter, fit), solution.left_out.unbiased_std
    problem = coordinates_of(total, known)
    start = problem.start()
    state = replace(start, friction=solution.friction.coefficients, numbers=solution.numbers)
    parts = parts_about(total, problem, state, noise, solution.deviations)
    shown = jackknife_root(parts, problem.prior_rows(state), noise)
    first, size = total.around.basis.size, 6 * len(TYPES)
    steps = problem.slopes(state)[first : first + size] @ shown
    by_noise, by_parts = (
        np.array(table_std(fit.chain, root)) for root in (solution.covariance_root[:size], steps)
    )
    assert len(parts) == 6
    widened = 0.5 * student.ppf(norm.cdf(2.0), 5) * by_parts
    found = np.array(table_deviations(total, solution, known))
    np.testing.assert_allclose(found, np.hypot(by_noise, widened), rtol=1e-3)


def test_samples_that_stand_for_all_weigh_as_much_where_folds_are_left_out() -> None:
    """Every sample comes nine times, and the noise is so large that the prior counts."""
    fitter, fit = fitted()
    few = fitter.dataset.select(np.arange(0, 200, 5))
    names = 't', 'q', 'dq', 'ddq', 'tau', 'segment', 'recording'
    arrays: dict[str, Any] = {x: np.repeat(getattr(few, x), 9, axis=0) for x in names}
    every = replace(few, **arrays)
    noisy = replace(fit, noise=replace(fit.noise, std=1e3 * fit.noise.std))
    out = np.arange(40) % 4 == 0
    some, whole = (
        left_out_fits(fitter.of(every), noisy, rows, [(mask, -1)])[0].residual
        for rows, mask in (
            (np.arange(0, 360, 9), out),
            (np.arange(360), np.repeat(out, 9)),
        )
    )
    np.testing.assert_allclose(some, whole[::9], rtol=1e-6, atol=1e-9)


def test_the_noise_is_found() -> None:
    np.testing.assert_allclose(known().noise.std, NOISE, rtol=0.2)


def test_every_link_can_exist() -> None:
    assert (np.linalg.eigvalsh(pseudo_inertia(known().links)) > 0.0).all()
    assert (known().links[:, 10] > 0.0).all()


def test_inertia_is_positive_definite_everywhere() -> None:
    arm, _ = recorded()
    q, _, _ = arm.motion(2000, seed=3)
    still = np.zeros_like(q)
    chain = known().chain._replace(gravity=np.zeros(3))
    units = [
        torque_regressor(chain, q, still, np.tile(unit, (len(q), 1))) @ known().links.ravel()
        for unit in np.eye(3)
    ]
    assert np.linalg.eigvalsh(np.stack(units, axis=2)).min() > 0.0


@pytest.mark.parametrize('k', [0, 4, 9, 17, 19, 28, 40, 51, 52, 57])
def test_the_jacobian_by_differences(k: int) -> None:
    """Placements by the descent's own steps; the others are linear where no load matters."""
    arm, _ = recorded()
    fitter, fit = fitted()[0], posterior(*fitted())[0]
    q, dq, ddq = arm.motion(20, seed=4)
    found = known().jacobian(q, dq, ddq)[:, :, k]
    dataset = dataset_of(arm, (q, dq, ddq), np.ones_like(q) + q)
    problem = fitter.problem(dataset, fit)
    step = np.zeros(problem.size)
    if k < 18:
        step[k] = 1e-6
        change = problem.torque(problem.stepped(fit.state, step))
        change -= problem.torque(problem.stepped(fit.state, -step))
        expected = change / 2e-6
    elif k < 51:
        links = np.zeros(33)
        links[k - 18] = 1.0
        expected = links_torque(fit.chain, links.reshape(3, 11), dataset)
    else:
        expected = problem.jacobian(fit.state)[:, :, k]
    scale = max(float(np.abs(expected).max()), 1e-3)
    np.testing.assert_allclose(found, expected, atol=2e-5 * scale)


def test_loads_follow_the_links_by_differences() -> None:
    """Friction that grows with the load, and a torque in the effort of the joint beside it."""
    fitter, fit = fitted()
    loaded = DriveTerm(Drive.of_joint(0), load_coulomb(0.1))
    coupled = DriveTerm(Drive.transmitted(2, to=1), load_torque())
    basis = FrictionBasis(3, (*fit.friction.basis.terms, loaded, coupled))
    friction = FrictionModel(basis, np.append(fit.friction.coefficients, [0.2, 0.7]))
    fit = replace(fit, friction=friction)
    some = fitter.some(20)
    numbers = np.append(fit.state.friction, [np.log(0.2), 0.7])
    fit = replace(fit, state=replace(fit.state, friction=numbers))
    problem = fitter.problem(some, fit)
    found, residual = linearised(problem, some, fit)
    np.testing.assert_allclose(residual, some.tau - torque_of(fit, some), atol=1e-9)
    check_rows(fitter, fit, some, found, residual)
    by_steps = np.ones(problem.size)
    by_steps[-basis.size :] = problem.coefficient_slopes(fit.state)
    for k, step in enumerate(1e-6 * np.eye(problem.size)):
        up, down = (
            torque_of(fitter.at(fit, problem, problem.stepped(fit.state, way)), some)
            for way in (step, -step)
        )
        expected = (up - down) / 2e-6 / by_steps[k]
        scale = max(float(np.abs(expected).max()), 1e-3)
        np.testing.assert_allclose(found[:, :, k], expected, atol=2e-5 * scale)


def check_rows(
    fitter: ArmFitter, fit: ArmFit, some: Dataset, jacobian: Array, residual: Array
) -> None:
    """Compare the rows of statistics, and their slopes by a step, with a Jacobian."""
    around = around_fit(some, fit)
    total = Total(around, [gather(some, around)])
    none = FrictionDeviations.none(fit.friction.basis.size)
    problem = system_of(total, known_of(fitter, fit), fit.noise.std, none)
    state = problem.start()
    slopes, parameters = problem.slopes(state), problem.parameters(state)
    features, target = around.rows(some)
    for joint, (rows, own) in enumerate(zip(features, around.columns, strict=True)):
        own_slopes = np.roll(slopes[np.concatenate(own)], -fit.friction.basis.size, axis=1)
        scale = np.abs(jacobian[:, joint]).max()
        np.testing.assert_allclose(rows @ own_slopes, jacobian[:, joint], atol=1e-9 * scale)
        left = target[:, joint] - rows @ parameters[np.concatenate(own)]
        np.testing.assert_allclose(left, residual[:, joint], atol=1e-9)


def torque_of(fit: ArmFit, dataset: Dataset) -> Array:
    load = links_torque(fit.chain, fit.links, dataset)
    return load + fit.friction.torque(dataset.q, dataset.dq, dataset.ddq, load)


def test_two_standard_deviations_cover_the_truth() -> None:
    covered, measured = [], []
    for seed in range(4):
        arm = random_arm((R, R), seed=10 + seed)
        motion = arm.motion(60, seed=0)
        rng = np.random.default_rng(seed)
        tau = arm.torque(*motion) + friction(motion[1])
        fitter = ArmFitter(dataset_of(arm, motion, tau + 0.3 * rng.standard_normal(tau.shape)))
        fit = started(fitter)
        found = posterior(fitter, fitter.refined(fitter.dataset, fit))[1]
        unseen = arm.motion(300, seed=5)
        truth = arm.torque(*unseen) + friction(unseen[1])
        error = found.torque(*unseen) - truth
        covered.append(np.mean(np.abs(error) < 2.0 * found.torque_std(*unseen)))
        error = error + 0.3 * rng.standard_normal(truth.shape)
        measured.append(np.mean(np.abs(error) < 2.0 * found.measurement_std(*unseen)))
    assert np.mean(covered) > 0.8
    assert 0.9 < np.mean(measured) < 0.99


def smooth_motion(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    limits = MotionLimits(np.full(2, -1.5), np.full(2, 1.5), np.full(2, 2.0), np.full(2, 8.0))
    return SinusoidTrajectory.random(limits, rng).sample(np.arange(12_000) / 200.0)


def low_passed(arm: ChainArm, noise: float, rng: np.random.Generator) -> Dataset:
    q, dq, ddq = smooth_motion(rng)
    t, tau = np.arange(12_000) / 200.0, arm.torque(q, dq, ddq) + friction(dq)
    tau = tau + noise * rng.standard_normal(tau.shape)
    return preprocess(JointSamples(t, q, dq, tau, ('a', 'b')))


def test_the_estimate_is_that_of_all_samples_as_the_covariance_is() -> None:
    arm = random_arm((R, R), seed=10)
    motion, rng = arm.motion(5000, seed=0), np.random.default_rng(0)
    tau = arm.torque(*motion) + friction(motion[1])
    fitter = ArmFitter(dataset_of(arm, motion, tau + 0.3 * rng.standard_normal(tau.shape)))
    start = started(fitter)
    few = fitter.refined(fitter.some(1000), start)
    fit, found, *_ = posterior(fitter, few)
    gains = []
    for each in (few, fit):
        problem = fitter.problem(fitter.dataset, each)
        hessian, slope = problem.normal_equations(problem.evaluated(each.state))
        gains.append(0.5 * slope @ np.linalg.solve(hessian, slope))
    assert gains[0] > 2.0
    assert gains[1] < 0.5
    unseen = arm.motion(500, seed=5)
    error = found.torque(*unseen) - arm.torque(*unseen) - friction(unseen[1])
    assert np.mean(np.abs(error) < 2.0 * found.torque_std(*unseen)) > 0.85


@cache
def fitted_to_low_passed(noise: float) -> Identified:
    arm, rng = random_arm((R, R), seed=10), np.random.default_rng(0)
    return identify(low_passed(arm, noise, rng))


@pytest.mark.parametrize('noise', [0.0, 0.02])
def test_low_passed_dry_friction_is_no_bias(noise: float) -> None:
    """Where friction is constant; signs of constant accelerations have many times the error."""
    arm, rng = random_arm((R, R), seed=10), np.random.default_rng(0)
    data = low_passed(arm, noise, rng)
    fits = fitted_to_low_passed(noise).arm, identify(replace(data, low_passed_sign=None)).arm
    q, dq, ddq = smooth_motion(rng)
    truth, clear = arm.torque(q, dq, ddq) + friction(dq), np.abs(dq) > 0.2 * np.abs(ddq) + 0.1
    errors = [np.where(clear, each.torque(q, dq, ddq) - truth, 0.0) for each in fits]
    sizes = [np.sqrt(np.sum(each**2, axis=0)) for each in errors]
    assert (sizes[0] < 0.2 * sizes[1]).all()
    std = fits[0].torque_std(q, dq, ddq)
    assert np.mean((np.abs(errors[0]) < 2.0 * std)[clear]) > 0.7


def test_measured_torques_have_the_noise_of_predictions_without_their_signs() -> None:
    arm, rng = random_arm((R, R), seed=10), np.random.default_rng(0)
    found, _ = fitted_to_low_passed(0.02), low_passed(arm, 0.02, rng)
    unseen = low_passed(arm, 0.02, rng)
    state = unseen.q, unseen.dq, unseen.ddq
    error = found.torque(*state) - unseen.tau
    deviations = np.abs(error) / found.arm.measurement_std(*state)
    assert (np.mean(deviations < 2.0, axis=0) > 0.9).all()
    assert deviations.max() < 6.0
    share = np.mean(error**2, axis=0) / unseen.tau.var(axis=0)
    np.testing.assert_allclose(found.unpredicted / share, 1.0, atol=0.5)
    assert (found.unexplained < 0.2 * share).all()


@pytest.mark.parametrize('seed', range(2))
def test_white_noise_that_grows_near_rest_is_not_taken_for_correlated(seed: int) -> None:
    arm = random_arm((R, R), seed=10 + seed)
    motion, rng = arm.motion(1500, seed=0), np.random.default_rng(seed)
    near = np.exp(-np.square(motion[1] / (0.4 * np.sqrt(np.mean(motion[1] ** 2, axis=0)))))
    noise = 0.1 * np.sqrt(1.0 + 16.0 * near) * rng.standard_normal(near.shape)
    fitter = ArmFitter(dataset_of(arm, motion, arm.torque(*motion) + friction(motion[1]) + noise))
    start = started(fitter)
    _, found, solution, _ = posterior(fitter, fitter.refined(fitter.some(1000), start))
    assert solution.inflation < 2.0
    np.testing.assert_allclose(found.noise.std, 0.1, rtol=0.1)
    unseen = arm.motion(1000, seed=5)
    error = found.torque(*unseen) - arm.torque(*unseen) - friction(unseen[1])
    std = found.torque_std(*unseen)
    assert np.mean(np.abs(error) < 2.0 * std) > 0.85
    assert 0.5 < np.sqrt(np.mean(std**2) / np.mean(error**2)) < 2.0


def test_widths_of_signs_are_as_certain_as_samples_near_rest_make_them() -> None:
    fitter, fit = fitted()
    data, dry = fitter.dataset, fit.friction.shape_std
    fit, _, solution, _ = posterior(fitter, fit)
    root = solution.covariance_root
    assert len(root) == 17 * len(TYPES) + fit.friction.basis.size + len(TYPES)
    std = np.linalg.norm(root[-len(TYPES) :], axis=1) / dry
    basis = fit.friction.with_shapes().basis
    features = basis.features(data.q, data.dq, data.ddq, np.zeros_like(data.dq))
    slopes = dry * np.diagonal(features[..., -len(TYPES) :], axis1=1, axis2=2)
    alone = fit.noise.std / np.sqrt(np.sum(fit.noise.weights(data.dq) * slopes**2, axis=0))
    assert (std > 0.9 * alone).all()
    assert (std < 3.0 * np.sqrt(solution.inflation) * alone).all()
    terms = (part.term for part in fit.friction.basis.terms)
    widths = np.array([term.parameters['width'] for term in terms if term.kind is coulomb])
    truth = np.where(np.sqrt(np.mean(data.dq**2, axis=0)) > 1.0, 0.1, 0.015)
    assert (np.abs(np.log(widths / truth)) < 4.0 * std).all()


def test_a_step_takes_in_samples_that_the_descent_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From a fit to a quarter of the samples, steps go more than half of the way to all."""
    monkeypatch.setattr('lip_id_ros.identification.arm_fit.MOST_AT_ONCE', 50)
    fitter, best = fitted()
    some = fitter.refined(fitter.some(50), best)
    stepped = posterior(fitter, some)[0]

    def mean_squares(fit: ArmFit) -> float:
        error = fitter.dataset.tau - torque_of(fit, fitter.dataset)
        return float(np.mean(error**2, axis=0).sum())

    gained = mean_squares(some) - mean_squares(stepped)
    assert gained > 0.5 * (mean_squares(some) - mean_squares(best))


def test_covering_samples_are_in_the_order_of_time() -> None:
    _, dataset = recorded()
    rows = covering(dataset, 30)
    assert rows.size == 30
    assert (np.diff(rows) > 0).all()
