"""Checks of a fitted model, and warnings about it and about the data it is evaluated on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import not_positive_definite_percent
from lip_id_ros.evaluation.tables import percent
from lip_id_ros.model import InverseDynamicsModel

MOST_CHECKED = 1000
"""Samples at which M(q) is checked, at most."""

USELESS_PERCENT = 90.0
"""A joint whose nMSE reaches this is predicted no better than by the mean of its torque."""


def with_checks(model: InverseDynamicsModel, training: Dataset) -> InverseDynamicsModel:
    """
    Add checks to the summary of a model, computed at samples of its training data.

    `inertia_not_pd_percent` is the share of samples at which M(q) is not positive definite,
    `inertia_min_eigenvalue` its smallest eigenvalue at any of them [kg m^2 or kg], and
    `unexplained_percent` the noise variance of each joint, or its error on left-out blocks where
    that is larger, in percent of the variance of its torque (None where that is constant).

    """
    smallest = np.linalg.eigvalsh(
        model.inertia_matrix(training.q[:: 1 + training.n_samples // MOST_CHECKED])
    )[:, 0]
    variance = training.tau.var(axis=0)
    squares = np.maximum(model.noise_std**2, _left_out_squares(model, variance))
    checks: dict[str, Any] = {
        'inertia_not_pd_percent': not_positive_definite_percent(smallest),
        'inertia_min_eigenvalue': float(smallest.min()),
        'unexplained_percent': [
            100.0 * float(square) / float(total) if total > 0.0 else None
            for square, total in zip(squares, variance, strict=True)
        ],
    }
    return replace(model, summary={**model.summary, **checks})


def _left_out_squares(model: InverseDynamicsModel, variance: Array) -> Array:
    """Return mean squares of the errors of links on left-out blocks; 0 where not known, (n,)."""
    shares = model.summary.get('unexplained_left_out')
    if shares is None:
        return np.zeros(len(variance))
    # the noise of a joint with a Gaussian process is its error on left-out blocks
    has_process = model.remainder.joints if model.remainder else np.zeros(len(variance), bool)
    return np.where(has_process, 0.0, np.asarray(shares) * variance)


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
    shares = summary.get('unexplained_percent', ())
    texts += no_better_than_mean(joint_names, shares, 'On left-out training data the model')
    if summary.get('searches_agreed') is False:
        texts.append(
            'Two searches for the placements of the joints ended in different ones: do not use '
            'the geometry, and record faster motion of all joints.'
        )
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


def is_useless(nmse_percent: float | None) -> TypeGuard[float]:
    """Whether a known error is no smaller than that of the torque's mean, or hardly."""
    return nmse_percent is not None and nmse_percent >= USELESS_PERCENT  # nan is not


def no_better_than_mean(
    joint_names: Sequence[str],
    nmse_percent: Sequence[float | None],
    subject: str = 'The model',
) -> list[str]:
    """
    Return a warning where a model predicts a torque no better than the torque's mean would.

    Parameters
    ----------
    joint_names : sequence of str, n of them
    nmse_percent : sequence of float or None
        Mean squared error per joint in percent of the variance of the torque; nan or None where
        the torque is constant. Empty where it is unknown.
    subject : str
        Begins the sentence.

    """
    useless = [
        (name, value)
        for name, value in zip(joint_names, nmse_percent, strict=False)
        if is_useless(value)
    ]
    if not useless:
        return []
    errors = ', '.join(f'{name} ({percent(value)} %)' for name, value in useless)
    return [
        f'{subject} predicts no better than the mean of the torque at {len(useless)} of '
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
