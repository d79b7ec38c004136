"""Checks of a fitted model, and warnings about it and about the data it is evaluated on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import not_positive_definite_percent
from lip_id_ros.identification.link_torques import link_prior_std
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.chain import distances_between, PARALLEL
from lip_id_ros.rigid_body.regressor import torque_regressor

MOST_SAMPLES = 150
CHANGE, LEAST_CHANGE = 0.5, 0.05  # of a distance: relative, and at least [m]
NATS = 5.0
"""Loss of log-posterior that a change of a distance must cause; 2 would do for white noise."""
SIGN_WIDTH = 0.05  # of Coulomb friction, relative to the root mean square velocity
FRICTION_STD = 10.0  # of friction coefficients a priori, relative to the torques
MOST_CHECKED = 1000
"""Samples at which M(q) is checked, at most."""

USELESS_PERCENT = 90.0
"""A joint whose nMSE reaches this is predicted no better than by the mean of its torque."""


def with_checks(model: InverseDynamicsModel, training: Dataset) -> InverseDynamicsModel:
    """
    Add checks to the summary of a model, computed at samples of its training data.

    `inertia_not_pd_percent` is the share of samples at which M(q) is not positive definite,
    `inertia_min_eigenvalue` its smallest eigenvalue at any of them [kg m^2 or kg], and
    `unexplained_percent` the noise variance of each joint in percent of the variance of its
    torque (None where that is constant). With rigid links, `identified_distances` marks the
    distances between axes that the torques identify.

    """
    smallest = np.linalg.eigvalsh(
        model.inertia_matrix(training.q[:: 1 + training.n_samples // MOST_CHECKED])
    )[:, 0]
    variance = training.tau.var(axis=0)
    checks: dict[str, Any] = {
        'inertia_not_pd_percent': not_positive_definite_percent(smallest),
        'inertia_min_eigenvalue': float(smallest.min()),
        'unexplained_percent': [
            100.0 * float(noise) ** 2 / float(total) if total > 0.0 else None
            for noise, total in zip(model.noise_std, variance, strict=True)
        ],
    }
    if model.arm is not None:
        known = identified_distances(model.arm.chain, training, model.noise_std)
        checks['identified_distances'] = known.tolist()
    return replace(model, summary={**model.summary, **checks})


def fit_cautions(joint_names: Sequence[str], summary: Mapping[str, Any]) -> list[str]:
    """
    Return what was unusual about a fit.

    Parameters
    ----------
    joint_names : sequence of str
    summary : mapping
        Of the model, after `with_checks`.

    Returns
    -------
    list of str
        Sentences, none where all went well.

    """
    texts = [note] if (note := summary.get('device_note')) else []
    texts += summary.get('description', {}).get('sentences', ())
    texts += no_better_than_mean(joint_names, summary.get('unexplained_percent', ()))
    if ignored := summary.get('ignored_settings'):
        texts.append(
            f'The fit did not use {", ".join(ignored)}: this kind of model has no such setting; '
            'leave it out, or choose another fit.kernel.'
        )
    if at_bounds := summary.get('at_bounds'):
        some = ', '.join(at_bounds[:4])
        texts.append(
            f'{len(at_bounds)} hyperparameters ran to a bound ({some}): the fit may interpolate '
            'the recording; evaluate it on unseen data before you trust it.'
        )
    if share := summary.get('inertia_not_pd_percent'):
        texts.append(
            f'The inertia matrix is not positive definite at {share:.3g} % of the training '
            'samples: accelerations were too small to identify it, or a light joint is hidden in '
            'the noise. Torques are not affected; do not invert M(q).'
        )
    return [str(text) for text in texts]


def copy_cautions(provenance: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each source that repeats an earlier one."""
    return [
        f'{each["repeated"]} of {each["samples"]} samples of {each["source"]} repeat an earlier '
        'recording and were left out.'
        for each in provenance.get('copies', ())
    ]


def no_better_than_mean(
    joint_names: Sequence[str], nmse_percent: Sequence[float | None]
) -> list[str]:
    """
    Return a warning where a model predicts a torque no better than the torque's mean would.

    Parameters
    ----------
    joint_names : sequence of str, n of them
    nmse_percent : sequence of float or None
        Mean squared error per joint in percent of the variance of the torque; nan or None where
        the torque is constant. Empty where it is unknown.

    """
    useless = [
        (name, value)
        for name, value in zip(joint_names, nmse_percent, strict=False)
        if value is not None and not math.isnan(value) and value >= USELESS_PERCENT
    ]
    if not useless:
        return []
    errors = ', '.join(f'{name} ({value:.3g} %)' for name, value in useless)
    return [
        f'The model predicts no better than the mean of the torque at {len(useless)} of '
        f'{len(joint_names)} joints (error in % of the variance): {errors}. Do not serve it; '
        'check the efforts, the order and the types of the joints with lip_id inspect, and '
        'record more motion.'
    ]


def training_data_warnings(model: Any, dataset: Dataset) -> list[str]:
    """
    Return a warning where a data set is, or may be, the training data of a model.

    Parameters
    ----------
    model : TorqueModel
        With `provenance`, and `process` where it keeps samples; an arm keeps none.
    dataset : Dataset
        With the model's joints in the model's order.

    Returns
    -------
    list of str
        Sentences; none where the data are new to the model.

    """
    process = getattr(model, 'process', None)
    own = _rows(process.states) if process else _rows(dataset)[:0]
    n_shared = int(np.isin(own, _rows(dataset)).sum())
    if n_shared:
        return [
            f'These are training data: {n_shared} of the {len(own)} samples of the model '
            f'are among the {dataset.n_samples} evaluated; errors on other motions may be larger.'
        ]
    known = _recordings(model.provenance)
    if any(recording in known for recording in _recordings(dataset.provenance)):
        return [
            'The model was fitted on samples of the same recording; '
            'errors on other motions may be larger.'
        ]
    return []


def _rows(states: Any) -> NDArray[np.void]:
    """View the positions and velocities of each sample as one value that can be compared."""
    motion = np.ascontiguousarray(np.hstack([states.q, states.dq]))
    return motion.view(np.dtype((np.void, motion.itemsize * motion.shape[1]))).ravel()


def _recordings(provenance: Mapping[str, Any]) -> list[str]:
    """Return the digests of the recordings' contents, since files are renamed and moved."""
    sources = provenance.get('sources', ())
    known = [source for source in sources if isinstance(source, Mapping)]
    return [digest for source in known if (digest := source.get('content'))]


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
