"""From predictions to figures, with an estimator whose errors are known."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
import json
import math
from pathlib import Path
from typing import Any

from evaluation.stubs import Knowing
from model.models import random_model
import numpy as np
import pytest
from rich.console import Console
from simulation.pendulums import swing

from lip_id_ros.errors import DataError, ModelError
from lip_id_ros.evaluation import evaluate, matched, run, score
from lip_id_ros.evaluation.prediction import (
    predicted_values,
    standard_deviation,
    write_prediction,
)
from lip_id_ros.evaluation.tables import error_table, notes, percent, show, Table
from lip_id_ros.files import read_npz
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED

KEYS = {
    'joint_names',
    'n_samples',
    'nmse_percent',
    'nmse_percent_mean',
    'rmse',
    'rmse_in_motion',
    'rmse_near_rest',
    'near_rest_percent',
    'kinetic_nmse_percent',
    'potential_nmse_percent',
    'inertia_not_pd_percent',
    'inertia_min_eigenvalue',
    'within_two_std_percent',
    'novelty',
}


def test_evaluate_takes_joints_in_any_order() -> None:
    names = Knowing.joint_names
    evaluation = evaluate(Knowing(torque_error=0.2), swing(1).with_joints(names[::-1]))
    assert evaluation.to_json() == evaluate(Knowing(torque_error=0.2), swing(1)).to_json()
    with pytest.raises(DataError, match='expected in the data set'):
        evaluate(Knowing(), swing(1).with_joints(names[1:]))


def test_the_truth_has_no_error() -> None:
    evaluation = evaluate(Knowing(), swing(1))

    np.testing.assert_allclose(evaluation.nmse_percent, 0.0, atol=1e-20)
    assert evaluation.kinetic_nmse_percent == pytest.approx(0.0, abs=1e-20)
    assert evaluation.potential_nmse_percent == pytest.approx(0.0, abs=1e-20)
    assert evaluation.inertia_not_pd_percent == 0.0
    assert evaluation.inertia_min_eigenvalue == pytest.approx(0.2)
    assert evaluation.against_truth


def test_known_errors_are_found() -> None:
    data = swing(1)
    assert data.tau_noiseless is not None
    assert data.kinetic is not None
    evaluation = evaluate(Knowing(torque_error=0.2, energy_error=0.1, offset=50.0), data)

    np.testing.assert_allclose(evaluation.rmse, 0.2)
    np.testing.assert_allclose(
        evaluation.nmse_percent, 100 * 0.04 / np.var(data.tau_noiseless, axis=0)
    )
    assert evaluation.nmse_percent_mean == pytest.approx(np.mean(evaluation.nmse_percent))
    assert evaluation.kinetic_nmse_percent == pytest.approx(1.0 / np.var(data.kinetic))
    assert evaluation.potential_nmse_percent == pytest.approx(0.0, abs=1e-20)


def test_measured_torques_serve_where_the_true_ones_are_unknown() -> None:
    data = replace(swing(1, noise=0.3), tau_noiseless=None, kinetic=None, potential=None)
    evaluation = evaluate(Knowing(), data)

    np.testing.assert_allclose(evaluation.rmse, 0.3, rtol=0.1)
    assert not evaluation.against_truth
    assert evaluation.kinetic_nmse_percent is None
    assert evaluation.potential_nmse_percent is None
    assert 'measured torques' in notes(evaluation)[0]


def test_a_model_without_potential_energy_is_not_asked_for_it() -> None:
    evaluation = evaluate(Knowing(offset=None), swing(1))

    assert evaluation.potential_nmse_percent is None
    assert evaluation.kinetic_nmse_percent is not None


def test_indefinite_inertia_is_reported() -> None:
    evaluation = evaluate(Knowing(inertia=np.array([0.5, 0.3, -0.02])), swing(1))

    assert evaluation.inertia_not_pd_percent == 100.0
    assert evaluation.inertia_min_eigenvalue == pytest.approx(-0.02)
    assert 'positive definite at 0 % of the samples only' in notes(evaluation)[-1]


def test_novelty_is_that_of_motion() -> None:
    data, model = swing(1), random_model(ARTICULATED)
    every = model.novelty(data.q, data.dq, data.ddq)
    rest = np.arange(data.n_samples) < data.n_samples // 3
    stopped = replace(data, dq=np.where(rest[:, None], 0.0, data.dq))
    evaluation = score(run(model, stopped))
    assert evaluation.novelty == pytest.approx(np.median(every[~rest]))
    assert evaluation.to_json()['novelty'] == evaluation.novelty
    assert any(f'Novelty {evaluation.novelty:.2g}: ' in each for each in notes(evaluation))
    unknown = score(run(replace(model, known_states=None), stopped))
    assert unknown.novelty is None
    assert not any('Novelty' in each for each in notes(unknown))


def test_json_holds_the_documented_keys_and_no_nan() -> None:
    data = swing(1)
    still = np.array(data.tau_noiseless)
    still[:, 1] = 2.0
    evaluation = evaluate(Knowing(offset=None), replace(data, tau_noiseless=still))

    figures = evaluation.to_json()

    assert set(figures) == KEYS
    assert json.loads(json.dumps(figures, allow_nan=False)) == figures
    assert figures['nmse_percent'][1] is None
    assert figures['potential_nmse_percent'] is None
    assert figures['nmse_percent_mean'] == pytest.approx(0.0, abs=1e-20)
    assert figures['joint_names'] == ['shoulder', 'elbow', 'wrist']


def test_a_joint_that_never_varies_leaves_no_mean() -> None:
    data = swing(1).select([0])
    figures = evaluate(Knowing(), data).to_json()

    assert figures['nmse_percent_mean'] is None


def test_work_is_done_in_blocks_and_reported() -> None:
    data = swing(1, duration=60.0)
    estimator, reports = Knowing(), []
    outcome = run(estimator, data, lambda *report: reports.append(report))

    assert data.n_samples == 1200
    assert estimator.calls == [500, 500, 200]
    assert reports[-1] == ('predict', 1200, 1200)
    np.testing.assert_array_equal(
        outcome.prediction.tau, Knowing().predict(data.q, data.dq, data.ddq).tau
    )


def test_deviations_are_joined_too() -> None:
    data = swing(1).select(range(120))
    std = standard_deviation(Knowing(), data)

    assert std.tau.shape == (120, 3)
    assert std.potential is not None
    assert std.potential.shape == (120,)
    assert standard_deviation(Knowing(offset=None), data).potential is None


@pytest.mark.parametrize('sureness', [1.0, 1e-6])
def test_the_share_within_two_deviations_is_that_of_measured_torques(sureness: float) -> None:
    """Half of the torques of the first joint are three deviations away, the others one."""
    model, data = random_model(ARTICULATED, residual_gp=False), swing(1).select(range(40))
    assert model.arm is not None
    root = sureness * model.arm.covariance_root  # if small, there is hardly more than noise
    model = replace(model, arm=replace(model.arm, covariance_root=root))
    found = model.predict(data.q, data.dq, data.ddq, return_std=True)
    assert found.std is not None
    away = np.ones_like(data.q)
    away[::2, 0] = -3.0
    evaluation = score(run(model, replace(data, tau=found.tau + away * found.std.measurement)))

    assert evaluation.within_two_std_percent == (50.0, 100.0, 100.0)
    assert evaluation.to_json()['within_two_std_percent'] == [50.0, 100.0, 100.0]
    assert [row[-1] for row in error_table(evaluation).rows[:3]] == ['50', '100', '100']


def test_a_model_without_links_has_no_coverage() -> None:
    outcome = run(random_model('lip'), swing(1).select([0]))
    assert score(outcome).within_two_std_percent is None


def smoothed(cutoff_hz: float, filtered: bool = True) -> dict[str, Any]:
    return {'preprocessing': {'cutoff_hz': cutoff_hz}, 'filtered': filtered}


@pytest.mark.parametrize(
    ('of_fit', 'of_data', 'covered'),
    [
        ([smoothed(4.0)], [smoothed(4.0)], True),
        ([smoothed(4.0)], [smoothed(8.0)], False),
        ([smoothed(4.0)], [smoothed(4.0, filtered=False)], False),
        ([smoothed(8.0, filtered=False)], [smoothed(4.0, filtered=False)], True),
        ([smoothed(4.0)], [{'source': 'bare.npz'}], False),
        ([smoothed(4.0)], [smoothed(4.0), {'source': 'bare.npz'}], False),
        ([smoothed(4.0)], [], False),
        ([{'source': 'bare.npz'}], [{'source': 'bare.npz'}], True),
        (['simulation'], ['simulation'], True),
        ([{'source': 'bare.npz'}], [smoothed(4.0)], False),
        ([smoothed(4.0), {'source': 'of a fleet'}], [smoothed(4.0)], True),
        ([smoothed(4.0), {'source': 'of a fleet'}], [{'source': 'bare.npz'}], False),
    ],
)
def test_coverage_is_left_out_where_efforts_had_another_low_pass(
    of_fit: list[Any], of_data: list[Any], covered: bool
) -> None:
    model = replace(random_model(ARTICULATED), provenance={'sources': of_fit})
    data = replace(swing(1).select(range(5)), provenance={'sources': of_data})
    assert (score(run(model, data)).within_two_std_percent is not None) == covered


def test_joints_are_matched_by_name() -> None:
    data = swing(1)
    turned = data.with_joints(('wrist', 'shoulder', 'elbow'))

    np.testing.assert_array_equal(matched(turned, data).q, data.q)


def test_a_missing_joint_is_named() -> None:
    data = swing(1)
    with pytest.raises(DataError, match=r'^joint wrist expected in the data set, which has'):
        matched(data.with_joints(('shoulder', 'elbow')), data)


def test_a_joint_of_another_type_is_named() -> None:
    data = swing(1)
    other = replace(data, joint_types=('revolute', 'prismatic', 'revolute'))
    with pytest.raises(ModelError, match=r"joint 'elbow' must be revolute .* but is prismatic"):
        matched(other, data)


def test_torques_without_gravity_are_no_torques_with_it() -> None:
    data, model = swing(1), random_model(ARTICULATED, swing(1).joint_types)
    named = replace(data, joint_names=model.joint_names, joint_types=model.joint_types)
    for known in (named, model):
        with pytest.raises(ModelError, match=r'leave gravity out, but .* contain gravity'):
            matched(replace(named, gravity_compensated=True), known)
    with pytest.raises(ModelError, match=r'contain gravity, but .* leave gravity out'):
        matched(named, replace(named, gravity_compensated=True))


def test_table_shows_every_joint_and_energy() -> None:
    table = error_table(evaluate(Knowing(torque_error=0.2), swing(1)), 'Here')

    assert table.title == 'Here'
    assert [row[0] for row in table.rows] == [
        'shoulder',
        'elbow',
        'wrist',
        'mean of the joints',
        'geometric mean',
        'kinetic energy',
        'potential energy',
    ]
    assert table.rows[0][2] == '0.2 N m'


@pytest.mark.parametrize(
    ('value', 'text'),
    [
        *((math.nan, '-'), (0.0, '<0.0001'), (0.01234, '0.0123'), (3.14159, '3.14')),
        *((42.0, '42'), (999.6, '1000'), (12345.6, '12346')),
    ],
)
def test_percent(value: float, text: str) -> None:
    assert percent(value) == text


def test_a_title_is_one_line_however_narrow_its_table() -> None:
    printed = StringIO()
    title = 'a title of more words than the table is wide'
    show(Table(title, ('',), [('x',)]), Console(file=printed))
    assert printed.getvalue().splitlines()[0].rstrip() == title


def test_npz_holds_everything_predicted(tmp_path: Path) -> None:
    data, estimator, path = swing(1), Knowing(torque_error=0.1), tmp_path / 'out.npz'

    write_prediction(path, data, predicted_values(estimator, run(estimator, data)))

    arrays, header = read_npz(path)
    expected = estimator.predict(data.q, data.dq, data.ddq)
    assert header['format'] == 'lip_id_ros prediction'
    assert set(header['units']) == set(arrays) - {'segment', 'joint_names'}
    for name in ('tau', 'inertial', 'coriolis', 'gravity', 'friction', 'kinetic', 'potential'):
        np.testing.assert_array_equal(arrays[name], getattr(expected, name))
    np.testing.assert_array_equal(arrays['tau_measured'], data.tau)
    np.testing.assert_array_equal(arrays['t'], data.t)
    deviation = estimator.predict(data.q, data.dq, data.ddq, return_std=True).std
    assert deviation is not None
    assert deviation.potential is not None
    for name in ('tau', 'measurement', 'kinetic', 'potential'):
        np.testing.assert_array_equal(arrays[f'{name}_std'], getattr(deviation, name))
    assert arrays['joint_names'].tolist() == list(data.joint_names)


def test_npz_without_potential_energy(tmp_path: Path) -> None:
    estimator = Knowing(offset=None)

    write_prediction(
        tmp_path / 'out.npz', swing(1), predicted_values(estimator, run(estimator, swing(1)))
    )

    arrays, _ = read_npz(tmp_path / 'out.npz')
    assert not {'potential', 'potential_std'} & set(arrays)
