"""How fast a joint has to be for its friction to have a sign: the width of the smooth sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import FitError
from lip_id_ros.kernels import Hyperparameters, TorqueKernel, TorquePrior
from lip_id_ros.kernels.jointwise import Friction, JointwiseKernel
from lip_id_ros.linear_algebra import CholeskyFactor

Array = NDArray[np.float64]

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
    for place, term in enumerate(kernel.jointwise):
        if isinstance(term, Friction):
            likely = _likely(kernel, hyperparameters, dataset, place, term)
            return replace(kernel, jointwise=_replaced(kernel.jointwise, place, likely))
    return kernel


def _likely(
    kernel: TorqueKernel,
    hyperparameters: Hyperparameters,
    dataset: Dataset,
    place: int,
    term: Friction,
) -> Friction:
    states = kernel.states(dataset.q, dataset.dq, dataset.ddq)
    gram = TorquePrior(kernel, hyperparameters).noisy_gram(states)
    parameters = hyperparameters.jointwise[place]
    n, y = dataset.n_joints, dataset.tau.ravel()
    widths = term.sign_width.copy()

    def covariance(joint: int, factor: float) -> Array:
        tried = widths.copy()
        tried[joint] = factor * term.sign_width[joint]
        x = Friction(tried).inputs(dataset.q, dataset.dq, dataset.ddq)[joint]
        return np.asarray((x * parameters[joint]) @ x.T)

    for joint in range(n):
        block = gram[joint::n, joint::n]
        rest = block - covariance(joint, 1.0)
        values = []
        for factor in FACTORS:
            block[...] = rest + covariance(joint, factor)
            values.append(_value(gram, y))
        best = FACTORS[int(np.argmin(values))]
        block[...] = rest + covariance(joint, best)
        widths[joint] = best * term.sign_width[joint]
    return replace(term, sign_width=widths)


def _value(gram: Array, y: Array) -> float:
    try:
        factor = CholeskyFactor.of(gram)
    except FitError:
        return np.inf
    return 0.5 * float(y @ factor.solve(y)) + 0.5 * factor.log_determinant()


def _replaced(
    terms: tuple[JointwiseKernel, ...], place: int, term: JointwiseKernel
) -> tuple[JointwiseKernel, ...]:
    return (*terms[:place], term, *terms[place + 1 :])
