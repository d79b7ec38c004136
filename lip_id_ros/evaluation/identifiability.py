"""Which distances between joint axes the torques identify."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.link_torques import link_prior_std
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.chain import distances_between, PARALLEL
from lip_id_ros.rigid_body.regressor import torque_regressor

MOST_SAMPLES = 150
CHANGE, LEAST_CHANGE = 0.5, 0.05  # of a distance: relative, and at least [m]
NATS = 5.0
"""Loss of log-posterior that a change of a distance must cause; 2 would do for white noise."""
SIGN_WIDTH = 0.05  # of Coulomb friction, relative to the root mean square velocity
FRICTION_STD = 10.0  # of friction coefficients a priori, relative to the torques


def identified_distances(chain: Chain, dataset: Dataset, noise_std: Array) -> BoolArray:
    """
    Return which distances of an axis to the previous one the torques identify.

    Each distance is made shorter and longer by half, and the parameters of all links and of
    friction are fitted anew: where that costs hardly any posterior probability, the parameters
    compensate the distance.

    Parameters
    ----------
    chain : Chain
        Placements of the joints.
    dataset : Dataset
        The training data.
    noise_std : ndarray, shape (n,)
        Of the torques [N m or N].

    Returns
    -------
    ndarray of bool, shape (n - 1,)
        False also where there is no distance, at prismatic joints.

    """
    some = dataset.select(np.arange(0, dataset.n_samples, 1 + dataset.n_samples // MOST_SAMPLES))
    link_std = link_prior_std(some)
    best = _misfit(chain, link_std, some, noise_std)
    distances = distances_between(chain)
    identified = np.zeros(len(distances), dtype=bool)
    for j in np.flatnonzero(np.isfinite(distances)):
        change = max(CHANGE * distances[j], LEAST_CHANGE)
        step = change * _direction(chain, int(j) + 1)
        moved = [_moved(chain, int(j) + 1, sign * step) for sign in (-1.0, 1.0)]
        losses = [_misfit(each, link_std, some, noise_std) - best for each in moved]
        identified[j] = min(losses) > NATS
    return identified


def _direction(chain: Chain, joint: int) -> Array:
    """Return the unit vector along which a joint's axis moves away from the previous one."""
    axis, origin = chain.rotations[joint, :, 2], chain.translations[joint]
    normal = np.cross((0.0, 0.0, 1.0), axis)
    if np.linalg.norm(normal) <= PARALLEL:
        normal = np.array([origin[0], origin[1], 0.0])
    length = np.linalg.norm(normal)
    return normal / length if length > 0.0 else np.array([1.0, 0.0, 0.0])


def _moved(chain: Chain, joint: int, step: Array) -> Chain:
    translations = chain.translations.copy()
    outward = 1.0 if step @ translations[joint] >= 0.0 else -1.0
    translations[joint] += outward * step
    return chain._replace(translations=translations)


def _misfit(chain: Chain, link_std: Array, dataset: Dataset, noise_std: Array) -> float:
    """Return minus the log-posterior of the best links and friction, up to a constant."""
    q, dq, ddq = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
    speed = np.sqrt(np.mean(np.square(dq), axis=0)) + np.finfo(float).tiny
    own = (dq / speed, np.tanh(dq / (SIGN_WIDTH * speed)), np.ones_like(dq))
    diagonal = [x[:, :, None] * np.eye(dataset.n_joints) for x in own]
    friction_std = np.tile(FRICTION_STD * dataset.tau.std(axis=0), len(own))
    phi = np.concatenate([torque_regressor(chain, q, dq, ddq), *diagonal], axis=2)
    std = np.concatenate([link_std.ravel(), friction_std])
    # In units of the prior, whose rows are then those of the identity.
    rows = (phi * std / noise_std[:, None]).reshape(-1, len(std))
    tau = (dataset.tau / noise_std).ravel()
    gram = rows.T @ rows
    gram[np.diag_indices_from(gram)] += 1.0
    projected = rows.T @ tau
    return 0.5 * float(tau @ tau - projected @ CholeskyFactor.of(gram).solve(projected))
