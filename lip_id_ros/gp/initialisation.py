"""Initial guesses of the hyperparameters, and the widths of the smooth signs of friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import FitError
from lip_id_ros.kernels import (
    FrictionKernel,
    Hyperparameters,
    TorqueKernel,
    TorquePrior,
    Weights,
)
from lip_id_ros.kernels.program import EnergyKernel, unit_weights
from lip_id_ros.linear_algebra import CholeskyFactor, NOT_FINITE

NOISE_SHARE = 0.02
"""Initial standard deviation of the noise, as a share of each torque's."""

NOISIER = 5.0
"""Factor on the noise's standard deviation in the noisier starting points."""

WEAKER = 0.01
"""Factor on the scales of the kinetic energy in the weakest of them."""

SIGN_SHARE = 0.05
"""Initial width of the smooth sign of friction, as a share of each joint's usual velocity."""


FACTORS = (0.2, 0.5, 1.0, 2.0)
"""Of the initial width. Wider ones fit hard accelerations better and gentler motions worse."""


@dataclass(frozen=True)
class InitialGuess:
    """One point from which the optimisation may start, and the centre of the prior on it."""

    centre: Hyperparameters
    hyperparameters: Hyperparameters


def initial_guesses(kernel: TorqueKernel, dataset: Dataset) -> list[InitialGuess]:
    """
    Return guesses under which the energies explain all of the torques.

    They differ in the noise: little, much, and much with weak inertia. From little noise alone the
    first steps can collapse the noise of one joint, and the rest then interpolates; which guess is
    right shows after a few iterations.

    FitError if the data are not finite.
    """
    with np.errstate(over='ignore', divide='ignore'):
        centre = initial_hyperparameters(kernel, dataset)
        if not np.isfinite(centre.vector()).all():
            raise FitError(NOT_FINITE)
    noisy = replace(centre, noise_variance=centre.noise_variance * NOISIER**2)
    weak = noisy.weights._replace(kinetic_scales=noisy.weights.kinetic_scales * WEAKER)
    return [InitialGuess(centre, x) for x in (centre, noisy, replace(noisy, weights=weak))]


def initial_hyperparameters(kernel: TorqueKernel, dataset: Dataset) -> Hyperparameters:
    """Return the centre of the prior on the hyperparameters: the guess with little noise."""
    deviation = _positive(dataset.tau.std(axis=0))
    friction = None if kernel.friction is None else initial_friction(dataset.dq, deviation)
    return Hyperparameters(
        weights=initial_weights(kernel.energy, dataset.ddq, dataset.tau.var(axis=0)),
        friction=friction,
        noise_variance=(NOISE_SHARE * deviation) ** 2,
    )


def initial_weights(kernel: EnergyKernel, ddq: Array, variance: Array) -> Weights:
    """Weights under which the prior explains torques of this variance (n,), given ddq (N, n)."""
    torque = np.sqrt(np.mean(variance))
    acceleration = _root_mean_square(ddq)
    ones = unit_weights(kernel)
    return Weights(
        factors=ones.factors / 3.0,
        velocities=ones.velocities / acceleration,
        kinetic_scales=ones.kinetic_scales * torque**2,
        potential_factors=ones.potential_factors / 3.0,
        potential_scales=ones.potential_scales * torque**2,
    )


def initial_friction(dq: Array, deviation: Array) -> Array:
    """Return prior variances of friction that makes up a tenth of each torque, shape (n, 3)."""
    share = (0.1 * deviation) ** 2
    return np.column_stack([share / _root_mean_square(dq) ** 2, share, share])


def make_friction(dq: Array) -> FrictionKernel:
    """Return the friction kernel whose sign is smooth within a share of the usual velocity."""
    return FrictionKernel(sign_width=SIGN_SHARE * _root_mean_square(dq))


def _root_mean_square(x: Array) -> Array:
    return _positive(np.sqrt(np.mean(x**2, axis=0)))


def _positive(x: Array) -> Array:
    # A joint that never moved has no scale of its own.
    return np.where(x > 0.0, x, np.max(x) if np.max(x) > 0.0 else 1.0)


def with_likely_sign_widths(
    kernel: TorqueKernel, hyperparameters: Hyperparameters, dataset: Dataset
) -> TorqueKernel:
    """
    Choose the width of each joint's smooth sign by marginal likelihood, one after another.

    A low-pass smears the step of Coulomb friction over a tenth of a second, and friction near rest
    does so itself: over which velocities depends on the joint and its motion. Widths are
    multiplied by one of `FACTORS` each.
    """
    if kernel.friction is None or hyperparameters.friction is None:
        return kernel
    states = kernel.states(dataset.q, dataset.dq, dataset.ddq)
    gram = TorquePrior(kernel, hyperparameters).noisy_gram(states)
    y = dataset.tau.ravel()
    widths = kernel.friction.sign_width.copy()
    for joint, coulomb in enumerate(hyperparameters.friction[:, 1]):
        now, *tried = np.tanh(dataset.dq[:, joint] / np.outer((1.0, *FACTORS), widths[joint]))
        signs = np.zeros((len(tried) + 1, *dataset.tau.shape))
        signs[:, :, joint] = np.sqrt(coulomb) * np.array([now, *tried])
        values = _values(gram, y, *signs.reshape(len(signs), -1))
        best = int(np.argmin(values))
        block = gram[joint :: dataset.n_joints, joint :: dataset.n_joints]
        block += coulomb * (np.outer(tried[best], tried[best]) - np.outer(now, now))
        widths[joint] *= FACTORS[best]
    return replace(kernel, friction=FrictionKernel(widths))


def _values(gram: Array, y: Array, now: Array, *tried: Array) -> list[float]:
    """
    Return negative log likelihoods, up to a constant, where one vector replaces another.

    Half of y^T K^-1 y + log det K for K = gram - now now^T + z z^T of every z: one factorisation,
    and the lemmas of Woodbury and of the determinant.
    """
    factor = CholeskyFactor.of(gram)
    columns = factor.half_solve(np.column_stack([y, now, *tried]))
    products = columns.T @ columns
    sign = np.diag([-1.0, 1.0])
    values = []
    for z in range(2, len(products)):
        both = np.ix_((1, z), (1, z))
        change = sign + products[both]
        along = products[0, (1, z)]
        explained = float(along @ np.linalg.solve(change, along))
        values.append(0.5 * (np.log(-np.linalg.det(change)) - explained))
    return values
