"""Warnings in sentences: about recordings, a fit to them, and its errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lip_id_ros.dataset.formats import COPIES, FINDINGS, N_NOTES, SELECTED
from lip_id_ros.errors import ModelError
from lip_id_ros.evaluation.metrics import Evaluation
from lip_id_ros.evaluation.recording_health import finding_lines, listed
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.proof import has_held_out, known_errors, missing_proof, useless_on
from lip_id_ros.rigid_body.couplings import coupling_texts
from lip_id_ros.settings import PreprocessingSettings

SHORT, ENOUGH_S = 'short', 60.0
"""Length of all recordings together from which the length of each one is no concern [s]."""

MOST_EPISODES = 6
"""Times in one sentence, at most."""

LEAST_COVERED = 70.0
"""
Share of the measured torques within two standard deviations below which a caution says so [%].
"""

FAR_WORSE, LEAST_ERROR, MOST_DISTURBED = 5.0, 0.01, 0.2
"""
Error on all samples over that on left-out parts of those kept, and as a share of the variance, and
the share of samples left out as contacts, from which on what was left out may flatter a fit.
"""

MOSTLY_NEW, LITTLE_S = 0.5, 20.0
"""A motion repeats itself below this share of new motion, and shows little below that time [s]."""


def fit_cautions(model: InverseDynamicsModel, evaluation: Evaluation | None = None) -> list[str]:
    """
    Return what was unusual about recordings, a fit to them and, where given, its evaluation.

    ModelError where there is no model.
    """
    if not isinstance(model, InverseDynamicsModel):
        raise ModelError(
            f'cautions are those of a fitted model, not of {type(model).__name__}; pass what fit '
            'or InverseDynamicsModel.load returned.'
        )
    texts = [
        *data_remarks(model.provenance),
        *coupling_remarks(model),
        *summary_cautions(model.joint_names, model.summary),
        *_proof(model),
    ]
    if evaluation is None:
        return texts
    if has_held_out(model, evaluation.nmse_percent):  # which its proof is about
        return [*texts, *evaluation.cautions]
    return [*texts, *evaluation_cautions(evaluation)]


def _proof(model: InverseDynamicsModel) -> list[str]:
    lack = missing_proof(model)
    return [f'serve refuses this model unless accept_unproven is true: {lack}.'] if lack else []


def coupling_remarks(model: InverseDynamicsModel) -> list[str]:
    """Return a sentence on reported positions that are not those of a serial chain."""
    if model.arm is None or not model.arm.chain.couplings.size:
        return []
    listed = '; '.join(coupling_texts(model.arm.chain, model.joint_names))
    return [
        f'Reported positions are coupled ({listed}): such a joint moves by its position plus the '
        'ratio times that of the other joint. If that is not so, fit with fit.coupling none.'
    ]


def data_remarks(provenance: Mapping[str, Any]) -> list[str]:
    """Return what the provenance of a data set or model has about its recordings, in sentences."""
    return [*_findings(provenance), *copy_cautions(provenance), *_selections(provenance)]


def evaluation_cautions(evaluation: Evaluation) -> list[str]:
    """Return what makes the errors of an evaluation no success, or too small."""
    return [*_useless(evaluation), *_overconfident(evaluation), *evaluation.cautions]


def _overconfident(evaluation: Evaluation) -> list[str]:
    """Return a sentence on joints whose standard deviations are far too small, if any."""
    if evaluation.within_two_std_percent is None:
        return []
    covered = zip(evaluation.joint_names, evaluation.within_two_std_percent, strict=True)
    few = [f'{name} ({share:.3g} %)' for name, share in covered if share < LEAST_COVERED]
    if not few:
        return []
    return [
        'Standard deviations are too small for this motion where less than '
        f'{LEAST_COVERED:.0f} % of the measured torques lie within two of them, and 95 % are '
        f'expected: {listed(few)}. Do not use them as bounds of the error.'
    ]


def _useless(evaluation: Evaluation) -> list[str]:
    """Return a sentence on joints whose torque is hardly predicted, if any."""
    errors = known_errors(evaluation.nmse_percent)
    found = useless_on(evaluation.joint_names, [('this', errors)])
    return [f'Do not serve this model: {found}.'] if found else []


def summary_cautions(joint_names: Sequence[str], summary: Mapping[str, Any]) -> list[str]:
    """Return what the summary of a fit says that was unusual about it, see `fit_cautions`."""
    texts = list(summary.get('description', {}).get('sentences', ()))
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
        these, others = (listed(each) for each in groups)
        texts.append(
            f'{these} and {others} contradict each other, as if another load were at the last '
            'link: fit them apart.'
        )
    texts += _repetition(summary)
    texts += _disturbances(joint_names, summary.get('disturbances', ()))
    texts += _flattered(joint_names, summary)
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


def _repetition(summary: Mapping[str, Any]) -> list[str]:
    every, new = (summary.get(name, 0.0) for name in ('motion_s', 'new_motion_s'))
    if new >= MOSTLY_NEW * every or new >= LITTLE_S:
        return []
    return [
        f'The motion repeats itself: only {new:.2g} of {every:.3g} s are new, and errors on other '
        'motions may be much larger; record other motions too, not the same one for longer.'
    ]


def _disturbances(joint_names: Sequence[str], episodes: Sequence[Mapping[str, Any]]) -> list[str]:
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


def _flattered(joint_names: Sequence[str], summary: Mapping[str, Any]) -> list[str]:
    """Return a sentence on joints that look good by what was left out, if any."""
    keys = 'unexplained_of_all', 'unexplained_left_out', 'disturbed'
    shares = zip(joint_names, *(summary.get(key, ()) for key in keys), strict=False)
    found = [
        f'{name} {100 * every:.3g} % of the variance instead of {100 * judged:.3g} %, with '
        f'{100 * out:.3g} % of the samples left out as contacts'
        for name, every, judged, out in shares
        if every > max(FAR_WORSE * judged, LEAST_ERROR) or out > MOST_DISTURBED
    ]
    if not found:
        return []
    return [
        f'Over all samples, those left out included, the fit leaves unexplained: '
        f'{"; ".join(found)}. Look in the recording for contacts at the times left out: if there '
        'were none, do not use this model.'
    ]


def copy_cautions(provenance: Mapping[str, Any]) -> list[str]:
    """Return a sentence for each source that repeats an earlier one."""
    return [
        f'{each["repeated"]} of {each["samples"]} samples of {each["source"]} repeat an earlier '
        'recording and were left out.'
        for each in provenance.get(COPIES, ())
    ]


def _findings(provenance: Mapping[str, Any]) -> list[str]:
    sources = [each for each in provenance.get('sources', ()) if isinstance(each, Mapping)]
    several = len(sources) > 1
    found = [
        {**finding, 'source': source['source']} if several else finding
        for source in sources
        for finding in source.get(FINDINGS, ())
    ]
    if several and sum(map(_seconds, sources)) >= ENOUGH_S:
        found = [finding for finding in found if finding['code'] != SHORT]
    texts = finding_lines(found)
    if n_notes := sum(source.get(N_NOTES, 0) for source in sources):
        how = 'see them with lip_id inspect of the recording.'
        texts.append(f'Notes not shown here: {n_notes}; {how}')
    return texts


def _seconds(source: Mapping[str, Any]) -> float:
    rate = source.get('rate_hz', 0.0)
    return float(source.get('samples', 0) / rate) if rate else 0.0


def _selections(provenance: Mapping[str, Any]) -> list[str]:
    reports = [source[SELECTED] for source in provenance.get('sources', ()) if SELECTED in source]
    if not reports:
        return []
    report = reports[0]
    usual = f'{PreprocessingSettings().cutoff:g}'
    if 'too_few_samples' in report:
        return [
            f'Preprocessing: {report["too_few_samples"]} samples are too few to select a cut-off, '
            f'which stays at {usual} Hz.'
        ]
    errors = report['unexplained_left_out_percent']
    cutoff = f'{report["cutoff_hz"]:g}'
    why = ', the usual one, since none was clearly better' if cutoff == usual else ''
    listed = ', '.join(f'{each} Hz {error:.3g} %' for each, error in errors.items())
    lines = [
        f'Preprocessing selected by cross-validation: cut-off {cutoff} Hz{why}; derivative '
        f'{report["derivative"]}. '
        f'Share of left-out efforts that links do not explain: {listed}.'
    ]
    delays = report['effort_delay_s']
    if any(delays):
        listed = ', '.join(f'{1e3 * delay:.1f}' for delay in delays)
        lines.append(
            f'Efforts were measured later than positions by {listed} ms (base to tip), and are '
            f'shifted back: {report["unexplained_without_delays_percent"]:.3g} % of left-out '
            f'efforts were not explained before, {report["unexplained_with_delays_percent"]:.3g} '
            '% are not now.'
        )
    return lines
