"""`lip_id adapt`: recordings of a later day."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

from adaptation.arms import known_model, NOISE, stream, TYPES, with_friction
import numpy as np
import pytest

from lip_id_ros.adaptation.replay import replay
from lip_id_ros.adaptation.report import friction_figure
from lip_id_ros.cli import main
from lip_id_ros.dataset import Dataset
from lip_id_ros.model import InverseDynamicsModel

SECONDS = 40.0


@pytest.fixture(scope='module')
def day(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a model of a cold arm, and recordings of a cold and a warm one."""
    folder = tmp_path_factory.mktemp('day')
    cold = known_model()
    cold.save(folder / 'arm.npz')
    for name, factor in (('cold', 1.0), ('warm', 0.6)):
        data = stream(with_friction(cold, factor), SECONDS)
        Dataset(
            **data._asdict(),
            joint_names=cold.joint_names,
            joint_types=TYPES,
            segment=np.zeros(data.t.size, dtype=np.int64),
        ).save(folder / f'{name}.npz')
    return folder


def test_a_warm_arm_is_followed_and_its_model_written(
    day: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    now, figures = tmp_path / 'now.npz', tmp_path / 'figures.json'
    sources = [str(day / name) for name in ('arm.npz', 'cold.npz', 'warm.npz')]
    outputs = ['-o', str(now), '--json', str(figures), '--report', str(tmp_path / 'page')]
    assert main(['adapt', *sources, *outputs]) == 0
    shown = capsys.readouterr().out
    assert 'joint_2: friction at' in shown
    assert 'Recording 2' in shown
    found = json.loads(figures.read_text())
    cold, warm = found['recordings']
    assert cold['trusted_percent'] < 100.0 == cold['learned_percent']
    ratios = np.divide(warm['nmse_percent'], warm['frozen_nmse_percent'])
    assert (ratios < 0.5).all()
    rows = [line.split('│')[2:4] for line in shown.splitlines() if 'joint_1 ' in line]
    figures_shown = [float(cell) for cell in rows[1]]
    expected = warm['frozen_nmse_percent'][0], warm['nmse_percent'][0]
    assert figures_shown == pytest.approx(expected, rel=0.01)
    assert {each['joint'] for each in found['changes']} == {'joint_1', 'joint_2', 'joint_3'}
    page = (tmp_path / 'page' / 'index.html').read_text()
    assert 'An arm that changes' in page
    assert page.count('data:image/png') == 2
    after = stream(with_friction(known_model(), 0.6), 20.0, seed=3)
    error = InverseDynamicsModel.load(now).predict(*after[1:4]).tau - after.tau
    assert np.sqrt(np.mean(error**2)) < 1.2 * NOISE


def test_the_friction_that_is_drawn_is_that_at_a_usual_speed(day: Path) -> None:
    model = InverseDynamicsModel.load(day / 'arm.npz')
    found = replay(model, Dataset.load(day / 'cold.npz'), 0.0)
    assert model.arm is not None
    zero = np.zeros((1, len(TYPES)))
    for joint, panel in enumerate(friction_figure(found).axes):
        speed = found.adaptation.arm.speed * np.eye(len(TYPES))[joint, None]
        ways = [model.arm.friction.torque(zero, dq, zero, zero) for dq in (speed, -speed)]
        expected = 0.5 * (ways[0] - ways[1])[0, joint]
        learned, fitted, *_ = (np.asarray(line.get_ydata()) for line in panel.get_lines())
        np.testing.assert_allclose(fitted, expected)
        np.testing.assert_allclose(learned, expected, rtol=0.2)


def test_an_arm_that_has_not_changed_is_said_to_be_the_same(
    day: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(['adapt', str(day / 'arm.npz'), str(day / 'cold.npz')]) == 0
    assert 'No friction now differs surely' in capsys.readouterr().out


def test_a_model_that_is_still_the_fit_is_said_to_be_so(
    day: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = Dataset.load(day / 'warm.npz')
    data.select(data.t < 4.0).save(tmp_path / 'short.npz')
    now = tmp_path / 'now.npz'
    assert main(['adapt', str(day / 'arm.npz'), str(tmp_path / 'short.npz'), '-o', str(now)]) == 0
    assert 'is not trusted at the end' in ' '.join(capsys.readouterr().out.split())
    fitted, found = (InverseDynamicsModel.load(path).arm for path in (day / 'arm.npz', now))
    assert fitted is not None
    assert found is not None
    np.testing.assert_array_equal(found.friction.coefficients, fitted.friction.coefficients)


def test_a_pause_is_a_time(day: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(['adapt', str(day / 'arm.npz'), str(day / 'cold.npz'), '--pause', '-1'])
    assert 'number of seconds' in capsys.readouterr().err


def test_what_was_learned_returns_to_the_fit_in_a_long_pause(day: Path, tmp_path: Path) -> None:
    errors, figures = [], tmp_path / 'figures.json'
    for pause in ('0', '1e7'):
        sources = [str(day / name) for name in ('arm.npz', 'warm.npz', 'cold.npz')]
        assert main(['adapt', *sources, '--pause', pause, '--json', str(figures)]) == 0
        errors.append(json.loads(figures.read_text())['recordings'][1]['nmse_percent'])
    assert np.greater(errors[0], np.multiply(1.5, errors[1])).all()


def test_figures_of_torques_that_do_not_vary_are_none(day: Path, tmp_path: Path) -> None:
    """A recording of one sample has no variance to compare errors with."""
    Dataset.load(day / 'cold.npz').select(np.arange(1)).save(tmp_path / 'one.npz')
    figures = tmp_path / 'figures.json'
    sources = [str(day / 'arm.npz'), str(tmp_path / 'one.npz')]
    assert main(['adapt', *sources, '--json', str(figures)]) == 0
    (found,) = json.loads(figures.read_text())['recordings']
    assert found['nmse_percent'] == [None] * len(TYPES)
    assert found['seconds'] == 0.0


def test_the_mean_is_that_of_the_joints_whose_torque_varies(
    day: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = Dataset.load(day / 'cold.npz')
    tau = data.tau.copy()
    tau[:, 1] = 0.25
    replace(data, tau=tau).save(tmp_path / 'still.npz')
    figures = tmp_path / 'figures.json'
    sources = [str(day / 'arm.npz'), str(tmp_path / 'still.npz')]
    assert main(['adapt', *sources, '--json', str(figures)]) == 0
    (found,) = json.loads(figures.read_text())['recordings']
    first, none, last = found['frozen_nmse_percent']
    assert none is None
    (row,) = (x for x in capsys.readouterr().out.splitlines() if 'mean of the joints' in x)
    assert row.replace('│', ' ').split()[4] == f'{(first + last) / 2:.3g}'


def test_what_is_wrong_with_a_recording_is_told(
    day: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An effort that is a copy of another, and the same recording twice."""
    warm, log = Dataset.load(day / 'warm.npz'), tmp_path / 'copied.csv'
    tau = warm.tau[:, [0, 1, 1]]
    names = [f'{what}_{joint}' for what in ('q', 'dq', 'tau') for joint in warm.joint_names]
    table = np.column_stack([warm.t, warm.q, warm.dq, tau])
    np.savetxt(log, table, delimiter=',', header=','.join(['t', *names]), comments='')
    figures = tmp_path / 'figures.json'
    sources = [str(day / 'arm.npz'), str(log), str(day / 'warm.npz'), str(day / 'warm.npz')]
    assert main(['adapt', *sources, '--json', str(figures)]) == 0
    shown = ' '.join(capsys.readouterr().out.split())
    assert 'effort_copied' in shown
    assert 'repeat an earlier recording' in shown
    cautions = ' '.join(json.loads(figures.read_text())['cautions'])
    assert 'the effort of joint_3 is that of joint_2' in cautions
