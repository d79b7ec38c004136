"""How fast a joint has to be for its friction to have a sign: the width of the smooth sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.kernels import FrictionKernel, Hyperparameters, TorqueKernel, TorquePrior
from lip_id_ros.linear_algebra import CholeskyFactor

FACTORS = (0.2, 0.5, 1.0, 2.0)
"""Of the initial width. Wider ones fit hard accelerations better and gentler motions worse."""


def with_likely_sign_widths(
    kernel: TorqueKernel, hyperparameters: Hyperparameters, dataset: Dataset
) -> TorqueKernel:
    """
    Choose the width of each joint's smooth sign by marginal likelihood, one after another.

    A low-pass smears the step of Coulomb friction over a tenth of a second, and friction near rest
    does so itself: over which velocities depends on the joint and its motion.

    Parameters
    ----------
    kernel : TorqueKernel
        Its widths are multiplied by one of `FACTORS` each; without friction it is left as it is.
    hyperparameters : Hyperparameters
        At which the likelihood is compared.
    dataset : Dataset
        On which it is.

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
