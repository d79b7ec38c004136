"""Warnings about a fitted model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeGuard

from lip_id_ros.errors import ModelError
from lip_id_ros.evaluation.recording_health import serious_lines
from lip_id_ros.evaluation.tables import percent
from lip_id_ros.model import InverseDynamicsModel

MOST_EPISODES = 6
"""Times in one sentence, at most."""

MOST_NAMES = 12
"""Recordings of a group in one sentence, at most."""

USELESS_PERCENT = 90.0
"""A joint whose nMSE reaches this is predicted no better than by the mean of its torque."""


def fit_cautions(model: InverseDynamicsModel) -> list[str]:
    """Return what was unusual about a fit, in sentences; ModelError where there is no model."""
    if not isinstance(model, InverseDynamicsModel):
        raise ModelError(
            f'cautions are those of a fitted model, not of {type(model).__name__}; pass what fit '
            'or InverseDynamicsModel.load returned.'
        )
    found = serious_lines(model.provenance.get('findings', ()))
    return [*found, *summary_cautions(model.joint_names, model.summary)]


def summary_cautions(joint_names: Sequence[str], summary: Mapping[str, Any]) -> list[str]:
    """Return what the summary of a fit says that was unusual about it, see `fit_cautions`."""
    texts = list(summary.get('description', {}).get('sentences', ()))
    shares = summary.get('unexplained_percent', ())
    texts += no_better_than_mean(joint_names, shares, 'On left-out training data the model')
    texts += summary.get('suspicions', ())
    if summary.get('searches_agreed') is False:
        texts.append(
            'Two searches for the placements of the joints ended in different ones: do not use '
            'the geometry, and record faster motion of all joints.'
        )
    if summary.get('halves_agree') is False:
        texts.append(
            'The first and the second half of the samples contradict each other, as if a payload, '
            'friction or the scale of efforts had changed: fit them apart.'
        )
    if groups := summary.get('contradicting_recordings'):
        these, others = (_listed(each) for each in groups)
        texts.append(
            f'{these} and {others} contradict each other, as if another load were at the last '
            'link: fit them apart.'
        )
    texts += _disturbances(joint_names, summary.get('disturbances', ()))
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


def _listed(names: Sequence[str]) -> str:
    """Return names of recordings for a sentence, some of many."""
    more = f' and {len(names) - MOST_NAMES} more' * (len(names) > MOST_NAMES)
    return f'{", ".join(names[:MOST_NAMES])}{more}'


def _disturbances(joint_names: Sequence[str], episodes: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a sentence about the parts of the recordings that were left out, if any."""
    if not episodes:
        return []
    joints = sorted({joint for each in episodes for joint in each['joints']})
    several = any(each['recording'] or each.get('name') for each in episodes)
    times = [
        f'{each["start_s"]:.4g} to {each["end_s"]:.4g} s'
        + f' of {each.get("name", number)}' * several
        for each in episodes
        for number in [f'recording {each["recording"] + 1}']
    ]
    more = f' and {len(times) - MOST_EPISODES} more' * (len(times) > MOST_EPISODES)
    return [
        f'The torques of {", ".join(joint_names[joint] for joint in joints)} at '
        f'{", ".join(times[:MOST_EPISODES])}{more} contradict the rest of the data, as if the arm '
        'had been touched or efforts had not been measured, and were left out: see what happened '
        'then, and record without contact.'
    ]


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
