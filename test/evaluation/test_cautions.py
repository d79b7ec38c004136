"""Every output warns of a model that explains nothing."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path
from typing import Any

from evaluation.models import QUICK, small_model, training
from evaluation.stubs import Knowing
from kernels.cases import R
from model.models import random_model
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.evaluation import (
    data_remarks,
    evaluate,
    Evaluation,
    evaluation_cautions,
    fit_cautions,
    run,
    score,
)
from lip_id_ros.evaluation.cautions import summary_cautions
from lip_id_ros.evaluation.recording_health import finding_lines, health_table
from lip_id_ros.evaluation.report import Labels, write_report
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.model.proof import with_checks, with_held_out

NAMES = ('shoulder', 'elbow', 'wrist')
PROVEN = {'motion_s': 30.0, 'new_motion_s': 10.0, 'unexplained_percent': [1.0] * 3}
HARDLY = 'predicts hardly better than the mean of the torque'


def test_coupled_positions_are_said() -> None:
    model = random_model(ARTICULATED, types=(R, R, R), residual_gp=False)
    (text,) = [each for each in fit_cautions(model) if 'coupled' in each]
    assert text.startswith('Reported positions are coupled (joint_3 -0.7 joint_2): such a joint')
    assert not [each for each in fit_cautions(random_model('lip')) if 'coupled' in each]


def judged_with(*errors: float) -> Evaluation:
    return replace(evaluate(Knowing(), swing(1)), nmse_percent=errors, joint_names=NAMES)


def test_joints_hardly_predicted_are_named() -> None:
    sentence, *_ = evaluation_cautions(judged_with(80.5, 3.0, 162.0))
    assert sentence == (
        'Do not serve this model: on this motion it predicts hardly better than the mean of the '
        'torque at 2 of 3 joints (error in % of the variance): shoulder (80.5 %), wrist (162 %); '
        'check the efforts, the order and the types of the joints with lip_id inspect of the '
        'recording, and record more motion.'
    )


def test_standard_deviations_that_are_far_too_small_are_named() -> None:
    found = replace(judged_with(1.0, 3.0, 2.0), within_two_std_percent=(31.25, 70.0, 69.9))
    sentence, *rest = evaluation_cautions(found)
    assert sentence == (
        'Standard deviations are too small for this motion where less than 70 % of the measured '
        'torques lie within two of them, and 95 % are expected: shoulder (31.2 %), wrist '
        '(69.9 %). Do not use them as bounds of the error.'
    )
    assert rest == list(found.cautions)


def test_a_model_that_explains_something_is_not_warned_of() -> None:
    found = judged_with(79.0, 0.1, math.nan)
    assert evaluation_cautions(found) == list(found.cautions)


def test_errors_on_held_out_samples_are_said_once() -> None:
    errors, found = [1.0, 90.0, 2.0], judged_with(1.0, 90.0, 2.0)
    model = replace(random_model(ARTICULATED), summary=PROVEN)

    def said(model: InverseDynamicsModel) -> list[str]:
        return [each for each in fit_cautions(model, found) if 'hardly better' in each]

    (other,), (same,) = said(model), said(with_held_out(model, errors, 5.0))
    assert other.startswith('Do not serve this model: on this motion')
    assert same.startswith('serve refuses this model unless accept_unproven is true: on held-out')
    worse = with_held_out(
        replace(model, summary={**PROVEN, 'unexplained_percent': [99.0]}), errors, 5
    )
    (both,) = said(worse)
    assert 'on left-out motion' in both
    assert 'on held-out motion' in both


def test_noise_as_large_as_the_torque_is_a_caution_of_the_fit(tmp_path: Path) -> None:
    model, data = small_model(), training()
    standard = (data.tau - data.tau.mean(axis=0)) / data.tau.std(axis=0)
    hardly_noisier = replace(data, tau=standard * model.noise_std / np.sqrt(0.95))
    with_checks(model, hardly_noisier.q, hardly_noisier.tau).save(tmp_path / 'model.npz')
    found = InverseDynamicsModel.load(tmp_path / 'model.npz').summary
    np.testing.assert_allclose(found['unexplained_percent'], 95.0)
    (text,) = [each for each in fit_cautions(replace(model, summary=found)) if HARDLY in each]
    assert 'at 3 of 3 joints' in text
    good = with_checks(model, data.q, data.tau)
    assert not any(HARDLY in each for each in fit_cautions(good))


def test_a_fit_from_python_warns_of_torques_that_it_does_not_explain() -> None:
    tau = np.random.default_rng(0).standard_normal(training().tau.shape)
    model = fit(replace(training(), tau=tau), QUICK)
    assert any(HARDLY in text for text in fit_cautions(model))
    assert not any(HARDLY in text for text in fit_cautions(small_model()))


def test_a_constant_torque_has_no_share() -> None:
    tau = np.array(training().tau)
    tau[:, 1] = 2.0
    checked = with_checks(small_model(), training().q, tau)
    assert checked.summary['unexplained_percent'][1] is None


@pytest.mark.parametrize('more', [{}, {'unexplained_left_out': [2.0, 2.0, 2.0]}])
def test_errors_on_left_out_blocks_count_beyond_the_noise(more: dict[str, list[float]]) -> None:
    """Those of predictions, where what the fit leaves with its signs is another number."""
    model, data = small_model(), training()
    name = 'unpredicted_left_out' if more else 'unexplained_left_out'
    found, noise = (
        with_checks(
            replace(model, summary={**model.summary, **more, name: [share, 0.0, 0.0]}),
            data.q,
            data.tau,
        ).summary['unexplained_percent']
        for share in (1.2, 0.0)
    )
    assert found[0] == pytest.approx(120.0)
    assert noise[0] < 120.0
    assert found[1:] == noise[1:]


@pytest.mark.parametrize(('agreed', 'count'), [(True, 0), (False, 1)])
def test_searches_that_did_not_agree_are_a_caution(agreed: bool, count: int) -> None:
    cautions = summary_cautions(NAMES, {'searches_agreed': agreed})
    assert len([text for text in cautions if 'placements of the joints ended' in text]) == count


@pytest.mark.parametrize(
    ('every', 'new', 'count'), [(60.0, 6.5, 1), (60.0, 31.0, 0), (300.0, 21.0, 0), (5.0, 5.0, 0)]
)
def test_a_motion_that_repeats_itself_is_a_caution(every: float, new: float, count: int) -> None:
    cautions = summary_cautions(NAMES, {'motion_s': every, 'new_motion_s': new})
    assert len([text for text in cautions if 'only 6.5 of 60 s are new' in text]) == count


def test_what_is_missing_to_serve_a_model_is_a_caution() -> None:
    short = {'motion_s': 1.0, 'new_motion_s': 1.0, 'unexplained_percent': [1.0] * 3}
    model = replace(random_model(ARTICULATED), summary=short)
    *_, text = fit_cautions(model)
    assert text.startswith('serve refuses this model unless accept_unproven is true: its rec')
    proven = with_held_out(model, [1.0, 2.0, 3.0], 5.0)
    assert not [each for each in fit_cautions(proven) if 'serve' in each]


@pytest.mark.parametrize(('agree', 'count'), [(True, 0), (False, 1)])
def test_halves_that_contradict_each_other_are_a_caution(agree: bool, count: int) -> None:
    cautions = summary_cautions(NAMES, {'halves_agree': agree})
    assert len([text for text in cautions if 'first and the second half' in text]) == count


def test_episodes_that_were_left_out_are_named() -> None:
    episode = {'recording': 0, 'start_s': 12.25, 'end_s': 14.0, 'joints': (0, 2)}
    (text,) = summary_cautions(NAMES, {'disturbances': [episode]})
    assert text.startswith('The torques of shoulder, wrist at 12.25 to 14 s contradict the rest')
    later = {**episode, 'recording': 1, 'joints': (1,)}
    (text,) = summary_cautions(NAMES, {'disturbances': [episode, *[later] * 9]})
    assert 'shoulder, elbow, wrist at 12.25 to 14 s of recording 1, 12.25' in text
    assert 'of recording 2 and 4 more contradict' in text


@pytest.mark.parametrize(
    ('every', 'judged', 'disturbed', 'said'),
    [
        (1.1, 0.2, 0.1, 'elbow 110 % of the variance instead of 20 %, with 10 % of the samples'),
        (0.011, 1e-4, 0.0, 'elbow 1.1 % of the variance instead of 0.01 %, with 0 % of'),
        (0.02, 0.02, 0.21, 'elbow 2 % of the variance instead of 2 %, with 21 % of the samples'),
        (0.9, 0.2, 0.19, ''),
        (0.009, 1e-4, 0.0, ''),
    ],
)
def test_a_fit_that_looks_good_by_what_was_left_out_is_a_caution(
    every: float, judged: float, disturbed: float, said: str
) -> None:
    summary = {
        'unexplained_of_all': [0.01, every, 0.01],
        'unexplained_left_out': [0.01, judged, 0.01],
        'disturbed': [0.0, disturbed, 0.0],
    }
    texts = summary_cautions(NAMES, summary)
    assert len(texts) == bool(said)
    assert all(f'leaves unexplained: {said}' in text for text in texts)
    assert not summary_cautions(NAMES, {})


@pytest.mark.slow
def test_the_page_warns_of_joints_that_are_not_explained(tmp_path: Path) -> None:
    outcome = run(Knowing(torque_error=50.0), swing(1))
    page = write_report(tmp_path, outcome, score(outcome), None, Labels('Bad'))
    text = page.read_text(encoding='utf-8')
    assert 'class="warning">Do not serve this model: on this' in text
    assert evaluate(Knowing(), swing(1)).nmse_percent_mean < 1e-9


def finding(code: str, joint: str) -> dict[str, str]:
    return {'code': code, 'severity': 'warning', 'joint': joint, 'text': f'{joint or "it"} is so.'}


def test_findings_without_a_joint_are_counted() -> None:
    lines = finding_lines([finding('short', '')] * 4)
    assert lines == ['warning short: it is so. In all recordings: 4 times.']


def provenance(lengths: tuple[float, ...], *findings: dict[str, str]) -> dict[str, Any]:
    return {
        'sources': [
            {
                'source': f'run{number}',
                'samples': round(50.0 * seconds),
                'rate_hz': 50.0,
                'findings': findings,
                'notes_of_health': 1,
            }
            for number, seconds in enumerate(lengths, start=1)
        ]
    }


@pytest.mark.parametrize(('lengths', 'short'), [((18.0,) * 7, False), ((18.0, 18.0), True)])
def test_short_recordings_are_long_together(lengths: tuple[float, ...], short: bool) -> None:
    lines = data_remarks(provenance(lengths, finding('short', '')))
    assert any('warning short' in line for line in lines) == short


def test_findings_about_several_recordings_name_them() -> None:
    slow = [finding('slow', joint) for joint in 'ab']
    assert data_remarks(provenance((99.0,), *slow)) == [
        'warning slow: a is so.',
        'warning slow: b is so.',
        'Notes not shown here: 1; see them with lip_id inspect of the recording.',
    ]
    assert data_remarks(provenance((99.0, 99.0), *slow)) == [
        'warning slow: a is so. Likewise b. In run1, run2.',
        'Notes not shown here: 2; see them with lip_id inspect of the recording.',
    ]
    (line, _) = data_remarks(provenance((99.0,) * 20, *slow))
    assert line.endswith(', run11, run12 and 8 more.')


def test_an_evaluation_of_training_data_is_a_caution_of_its_fit() -> None:
    model, data = small_model(), training()
    judged = evaluate(model, data)
    assert judged.cautions
    assert fit_cautions(model, judged)[-1] in judged.cautions


def test_efforts_are_explained_in_percent() -> None:
    table = health_table({'lift': {'effort_explained': 0.25, 'velocity_rms': 0.5}})
    assert table.rows == [('lift', '0.5', '25 %')]
