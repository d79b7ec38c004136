"""
The Laplace posterior of an arm's parameters, from all samples (maths.md, section 13).

Around the best parameters torques are linear in all of them. One pass over blocks of samples
gathers the square-root statistics of the Jacobian and the residuals; a Gauss-Newton step from
these takes in what the samples of the descent have left out. Residuals of real recordings are
correlated in time, so that the covariance is scaled by what left-out blocks show.

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, LEAST_GAIN, MOST_AT_ONCE
from lip_id_ros.identification.arm_problem import ArmProblem, ArmState
from lip_id_ros.identification.link_torques import links_torque
from lip_id_ros.identification.statistics import (
    contiguous_blocks,
    TorqueStatistics,
    triangular,
)
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import link_parameter_jacobian
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

LEFT_OUT_BLOCKS = 6
CHUNK = 1000
"""Samples whose Jacobian is in memory at one time."""

MOST_INFLATION = 1e4

LEAST_FREEDOM = 0.1
"""Least share of the samples that counts as left after the parameters."""

DAMPINGS = (1e-6, 1e-3, 1e-1, 1.0)
"""
Of the Gauss-Newton steps, in squares of the columns, so that what is not identified stays finite.
"""

MOST_STEPS = 4

WIDTH_STD, LEAST_COULOMB = 1.0, 1e-9
"""
Deviation of the logarithm of a width a priori, and the least Coulomb friction that has one, in
the largest deviation of a torque.
"""

NONE: Array = np.empty(0)


@dataclass(frozen=True, eq=False)
class LeftOut:
    """
    What left-out blocks show.

    Attributes
    ----------
    block_squares : array, shape (K, n)
        Of residuals of each block that was left out, weighted, as shares of all samples times the
        number of blocks [(N m)^2 or N^2].
    inflation : float
        Factor of the covariance of the parameters with which these are explained; at least 1.
    noise_std : array, shape (n,)
        Standard deviation of what the parameters' covariance does not explain [N m or N].
    unbiased_std : array, shape (n,)
        Of the residuals of the fit to all samples, with its degrees of freedom [N m or N].

    """

    block_squares: Array
    inflation: float
    noise_std: Array
    unbiased_std: Array

    @property
    def mean_squares(self) -> Array:
        """Mean squared residuals of blocks that were left out, (n,) [(N m)^2 or N^2]."""
        return np.asarray(self.block_squares.mean(axis=0))


def posterior(fitter: ArmFitter, fit: ArmFit) -> tuple[ArmFit, ArmPosterior, LeftOut]:
    """
    Take in all samples, and return the posterior.

    Parameters
    ----------
    fitter : ArmFitter
    fit : ArmFit
        Fitted to some of the samples.

    Returns
    -------
    fit : ArmFit
        To all samples.
    posterior : ArmPosterior
    left_out : LeftOut

    """
    fit = fitter.to_all_samples(fit)
    blocks = block_statistics(fitter, fit)
    for _ in range(MOST_STEPS if fitter.dataset.n_samples > MOST_AT_ONCE else 0):
        before = fit
        fit, blocks = _gauss_newton(fitter, fit, blocks)
        if fit is before:
            break
    problem = fitter.problem(fitter.some(1), fit)
    left_out = measure_left_out(blocks, prior_rows(problem, fit.state), fit.noise.std)
    root = covariance_root(fitter, fit, blocks, left_out)
    noise = replace(fit.noise, std=left_out.noise_std)
    return fit, ArmPosterior(fit.chain, fit.links, fit.friction, noise, root), left_out


def root_with_sign_widths(fitter: ArmFitter, fit: ArmFit, left_out: LeftOut) -> Array:
    """Return a square root of the covariance that has the widths of signs as well."""
    friction = fit.friction.with_sign_widths()
    numbers = np.pad(fit.state.friction, (0, friction.basis.size - fit.friction.basis.size))
    wide = replace(fit, friction=friction, state=replace(fit.state, friction=numbers))
    coulomb = np.maximum(friction.coulomb, LEAST_COULOMB * fitter.torque_std.max())
    blocks = block_statistics(fitter, wide)
    return covariance_root(fitter, wide, blocks, left_out, 1.0 / (WIDTH_STD * coulomb))


def covariance_root(
    fitter: ArmFitter,
    fit: ArmFit,
    blocks: list[TorqueStatistics],
    left_out: LeftOut,
    of_widths: Array = NONE,
) -> Array:
    """Return S of the posterior; `of_widths` are precisions of its last coordinates a priori."""
    problem, whole = fitter.problem(fitter.some(1), fit), blocks[0].merge(*blocks[1:])
    prior = prior_rows(problem, fit.state)
    last = np.arange(len(prior) - of_widths.size, len(prior))
    prior[last, last] = of_widths
    root = _root(whole, prior, left_out.unbiased_std)
    return np.asarray(np.sqrt(left_out.inflation) * _coordinates(problem, fit.state, root))


def left_out_of(fitter: ArmFitter, fit: ArmFit) -> LeftOut:
    """Return what left-out blocks show of a fit to all samples."""
    prior = prior_rows(fitter.problem(fitter.some(1), fit), fit.state)
    return measure_left_out(block_statistics(fitter, fit), prior, fit.noise.std)


def block_statistics(fitter: ArmFitter, fit: ArmFit) -> list[TorqueStatistics]:
    """Gather the statistics of Jacobian and residuals, of contiguous blocks of all samples."""
    dataset = fitter.dataset
    number = contiguous_blocks(dataset.n_samples, LEFT_OUT_BLOCKS)
    size = fitter.problem(dataset.select(np.arange(1)), fit).size
    empty = TorqueStatistics.empty([np.arange(size)] * dataset.n_joints)
    blocks = []
    for k in range(int(number[-1]) + 1):
        statistics = empty
        rows = np.flatnonzero(number == k)
        for chunk in np.array_split(rows, -(-rows.size // CHUNK)):
            statistics = _updated(statistics, fitter, fit, dataset.select(chunk))
        blocks.append(statistics)
    return blocks


def linearised(problem: ArmProblem, dataset: Dataset, fit: ArmFit) -> tuple[Array, Array]:
    """
    Return how the torques of samples change with a step from a fit, and its residuals.

    Parameters
    ----------
    problem : ArmProblem
        Of the samples, around the fit.
    dataset : Dataset
    fit : ArmFit

    Returns
    -------
    jacobian : array, shape (N, n, m)
        The loads that friction bears change with the links.
    residual : array, shape (N, n)
        [N m or N].

    """
    jacobian = problem.jacobian(fit.state)
    if fit.friction.basis.is_loaded.any():
        load = links_torque(fit.chain, fit.links, dataset)
        loads = jacobian[..., : problem.size - fit.friction.basis.size]
        sign = dataset.low_passed_sign
        slopes = fit.friction.load_slopes(dataset.q, dataset.dq, dataset.ddq, load, sign)
        loads += slopes @ loads
    return jacobian, dataset.tau - problem.torque(fit.state)


def _updated(
    statistics: TorqueStatistics, fitter: ArmFitter, fit: ArmFit, dataset: Dataset
) -> TorqueStatistics:
    jacobian, residual = linearised(fitter.problem(dataset, fit), dataset, fit)
    features = list(jacobian.transpose(1, 0, 2))
    return statistics.update(features, residual, fit.noise.weights(dataset.dq))


def measure_left_out(
    blocks: Sequence[TorqueStatistics], prior: Array, noise_std: Array
) -> LeftOut:
    """
    Predict each block from the others.

    Parameters
    ----------
    blocks : sequence of TorqueStatistics
        Of Jacobian and residuals, in which all joints have all parameters.
    prior : array, shape (m, m + 1)
        Rows of the prior, in units of its standard deviations.
    noise_std : array, shape (n,)
        Root mean squares of the residuals of the fit to all samples [N m or N].

    """
    grams = np.array([[r.T @ r for r in block.factors] for block in blocks])
    count = np.sum([block.counts for block in blocks], axis=0)
    _, covariance = solved(grams.sum(axis=0), prior, noise_std)
    noise_std = _unbiased(noise_std, _spread(grams.sum(axis=0), covariance) / count)
    squares, expected = np.zeros((len(blocks), noise_std.size)), np.zeros(noise_std.size)
    for k, block in enumerate(blocks):
        step, covariance = solved(grams.sum(axis=0) - grams[k], prior, noise_std)
        squares[k] = block.squared_residuals(step)
        expected += _spread(grams[k], covariance)
    variance = noise_std**2
    total = squares.sum(axis=0)
    excess = np.sum(total / variance - count)
    inflation = float(np.clip(excess / np.sum(expected / variance), 1.0, MOST_INFLATION))
    unexplained = (total - inflation * expected) / count
    left_std = np.sqrt(np.maximum(unexplained, variance))
    return LeftOut(len(blocks) * squares / count, inflation, left_std, noise_std)


def solved(grams: Array, prior: Array, noise_std: Array) -> tuple[Array, Array]:
    """Return parameters and covariance from the Gram matrices of all joints' rows."""
    normal = np.tensordot(noise_std**-2.0, grams, axes=1) + prior.T @ prior
    factor = CholeskyFactor.of(np.ascontiguousarray(normal[:-1, :-1]))
    return factor.solve(normal[:-1, -1]), factor.inverse()


def _spread(grams: Array, covariance: Array) -> Array:
    """Return the sums of variances of the torques that a covariance of parameters makes, (n,)."""
    return np.asarray(np.einsum('iab,ab->i', grams[:, :-1, :-1], covariance))


def _gauss_newton(
    fitter: ArmFitter, fit: ArmFit, blocks: list[TorqueStatistics]
) -> tuple[ArmFit, list[TorqueStatistics]]:
    """Take a damped step to the best fit to all samples, where that is one."""
    problem = fitter.problem(fitter.some(1), fit)
    whole = blocks[0].merge(*blocks[1:])
    root = _root(whole, prior_rows(problem, fit.state), fit.noise.std)
    if 0.5 * np.sum(root[:-1, -1] ** 2) < LEAST_GAIN:
        return fit, blocks
    scale = np.linalg.norm(root[:-1, :-1], axis=0)
    before = _mean_squares(fitter, fit)
    for damping in DAMPINGS:
        rows = np.column_stack([np.diag(np.sqrt(damping) * scale), np.zeros(scale.size)])
        damped = triangular(root, rows)
        step = solve_triangular(damped[:-1, :-1], damped[:-1, -1])
        moved = fitter.at(fit, problem, problem.stepped(fit.state, step))
        squares = _mean_squares(fitter, moved)
        if np.log(squares / before).sum() < 0.0:
            std = np.maximum(np.sqrt(squares), fitter.least_noise)
            moved = replace(moved, noise=replace(fit.noise, std=std))
            return moved, block_statistics(fitter, moved)
    return fit, blocks


def _mean_squares(fitter: ArmFitter, fit: ArmFit) -> Array:
    """Return the weighted mean squared residuals of all samples, shape (n,)."""
    dataset = fitter.dataset
    squares = np.zeros(dataset.n_joints)
    for chunk in np.array_split(np.arange(dataset.n_samples), -(-dataset.n_samples // CHUNK)):
        some = dataset.select(chunk)
        torque = links_torque(fit.chain, fit.links, some)
        torque += fit.friction.torque(some.q, some.dq, some.ddq, torque, some.low_passed_sign)
        squares += np.sum(fit.noise.weights(some.dq) * (some.tau - torque) ** 2, axis=0)
    return squares / dataset.n_samples


def _unbiased(noise_std: Array, variance: Array) -> Array:
    """Return the noise with the degrees of freedom that the parameters took, shape (n,)."""
    share = variance / noise_std**2
    return np.asarray(noise_std / np.sqrt(np.maximum(1.0 - share, LEAST_FREEDOM)))


def _root(statistics: TorqueStatistics, prior: Array, noise_std: Array) -> Array:
    """Return the triangular factor of all rows, samples' and prior's, shape (m + 1, m + 1)."""
    return triangular(statistics.system(noise_std), prior)


def prior_rows(problem: ArmProblem, state: ArmState) -> Array:
    """Return the rows of the prior, (m, m + 1), in units of its standard deviations."""
    return np.column_stack([np.diag(problem.prior_precision()), -problem.prior_residual(state)])


def _coordinates(problem: ArmProblem, state: ArmState, root: Array) -> Array:
    """Return the square root of the covariance in the coordinates of `ArmPosterior`."""
    spread: Array = solve_triangular(root[:-1, :-1], np.eye(len(root) - 1))
    n = len(state.numbers)
    first, last = DIRECTIONS * n, (DIRECTIONS + LINK_PARAMETERS) * n
    spread[:first] = problem.geometry.projector(state.chain) @ spread[:first]
    links = spread[first:last].reshape(n, LINK_PARAMETERS, -1)
    by_numbers = link_parameter_jacobian(state.numbers, problem.link_scale)
    spread[first:last] = np.einsum('ikl,ilr->ikr', by_numbers, links).reshape(last - first, -1)
    spread[last:] *= problem.coefficient_slopes(state)[:, None]
    return spread
