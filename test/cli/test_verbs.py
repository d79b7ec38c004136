"""Every verb from arguments to files and output, on small recordings."""

from __future__ import annotations

from dataclasses import replace
import json
import os
from pathlib import Path
import subprocess
import sys

from cli.conftest import Capture, lip_id, Workshop
from gp.processes import process_of
import numpy as np
import pytest
from simulation.pendulums import swing

from lip_id_ros.cli import main
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import evaluate
from lip_id_ros.files import read_npz
from lip_id_ros.loading import load_dataset
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.preprocessing import for_training
from lip_id_ros.settings import read_config
from lip_id_ros.simulation import write_bag

VERBS = ('demo', 'fit', 'evaluate', 'dataset', 'inspect', 'predict', 'check-plan')


@pytest.mark.slow
def test_fit_writes_the_model_of_its_command_and_shows_its_joints(
    workshop: Workshop, here: Path, capsys: Capture
) -> None:
    lip_id('fit', workshop.bag, '-o', 'arm.npz', '--config', workshop.settings, '--seed', 0)

    model = InverseDynamicsModel.load('arm.npz')
    output = capsys.readouterr()
    assert model.joint_names == ('shoulder', 'elbow', 'wrist')
    assert model.kernel == 'articulated'
    assert model.n_samples == rows_to_learn_from(workshop)
    assert all(name in output.out for name in model.joint_names)
    assert 'Written: arm.npz' in output.out
    assert '--holdout' in output.out
    assert output.err.splitlines()[:2] == ['reading run', 'preprocessing']
    assert 'error' not in output.err
    assert list(here.iterdir()) == [here / 'arm.npz']

    # the command that made the model of the workshop
    states = np.random.default_rng(0).normal(size=(3, 5, 3))
    first = InverseDynamicsModel.load(workshop.model).predict(*states)
    np.testing.assert_allclose(model.predict(*states).tau, first.tau, rtol=1e-6)


def rows_to_learn_from(workshop: Workshop) -> int:
    config = read_config(workshop.settings)
    bag = load_dataset(workshop.bag, config)
    return for_training(bag, config.preprocessing, config.fit.kernel).n_samples


def test_fit_takes_kernel_and_joints_from_the_command_line(workshop: Workshop, here: Path) -> None:
    lip_id(
        'fit', workshop.bag, '-o', 'arm.npz', '--config', workshop.settings,
        '--kernel', 'lip', '--joints', 'wrist,elbow',
    )  # fmt: skip

    model = InverseDynamicsModel.load('arm.npz')
    assert model.kernel == 'lip'
    assert model.joint_names == ('wrist', 'elbow')


def test_held_out_samples_are_the_last_and_are_not_learned_from(
    workshop: Workshop, here: Path, capsys: Capture
) -> None:
    lip_id('dataset', workshop.bag, '-o', 'data.npz', '--config', workshop.settings)
    first, rest = Dataset.load('data.npz').split(0.75)
    capsys.readouterr()

    lip_id(
        'fit', 'data.npz', '-o', 'arm.npz', '--config', workshop.settings, '--holdout', 0.25,
        '--kernel', 'recursive',
    )  # fmt: skip

    model, output = InverseDynamicsModel.load('arm.npz'), capsys.readouterr().out
    assert np.isin(process_of(model).states.q[:, 0], first.q[:, 0]).all()
    assert 'the last 25 % of the samples' in output
    assert f'{rest.n_samples} samples, compared with the measured torques' in output
    assert 'Plots: lip_id evaluate arm.npz data.npz --last 0.25 --report DIR' in output

    lip_id('evaluate', 'arm.npz', 'data.npz', '--last', 0.25, '--json', 'last.json')
    rmse = json.loads((here / 'last.json').read_text())['rmse']
    assert rmse == list(evaluate(model, rest).rmse)


@pytest.mark.slow
def test_evaluate_writes_its_report(workshop: Workshop, here: Path, capsys: Capture) -> None:
    lip_id(
        'evaluate', workshop.model, workshop.other_bag, '--json', 'figures.json', '--report', 'out'
    )

    figures = json.loads((here / 'figures.json').read_text())
    output = capsys.readouterr().out
    assert figures['joint_names'] == ['shoulder', 'elbow', 'wrist']
    assert max(figures['nmse_percent']) < 5
    assert figures['kinetic_nmse_percent'] is None
    assert 'samples of the same recording' not in output
    page = (here / 'out' / 'index.html').read_text(encoding='utf-8')
    assert str(workshop.other_bag) in page
    assert 'samples of the same recording' not in page


def test_evaluating_training_data_is_told(workshop: Workshop, here: Path, capsys: Capture) -> None:
    lip_id('evaluate', workshop.model, workshop.bag, '--report', 'out')

    sentence = 'The model was fitted on samples of the same recording'
    assert sentence in capsys.readouterr().out
    assert sentence in (here / 'out' / 'index.html').read_text(encoding='utf-8')


def test_json_on_standard_output_is_nothing_but_json(workshop: Workshop, capsys: Capture) -> None:
    lip_id('evaluate', workshop.model, workshop.other_bag, '--json', '-')

    output = capsys.readouterr()
    assert json.loads(output.out)['n_samples'] > 100
    assert 'shoulder' in output.err


def test_recordings_are_prepared_as_for_the_fit(workshop: Workshop, here: Path) -> None:
    lip_id('predict', workshop.model, workshop.bag, '-o', 'as_fit.npz')
    lip_id('dataset', workshop.bag, '-o', 'data.npz', '--config', workshop.settings)
    (here / 'other.yaml').write_text('preprocessing: {cutoff_hz: 2.0}')
    lip_id('predict', workshop.model, workshop.bag, '-o', 'other.npz', '--config', 'other.yaml')

    as_fit, other = read_npz('as_fit.npz')[0], read_npz('other.npz')[0]
    np.testing.assert_array_equal(as_fit['tau_measured'], Dataset.load('data.npz').tau)
    assert as_fit['tau_measured'].shape != other['tau_measured'].shape


def test_settings_bind_scales_to_their_own_order_of_joints(workshop: Workshop, here: Path) -> None:
    names = load_dataset(workshop.bag).joint_names
    order = [names[2], names[0], names[1]]
    settings = {'joints': order, 'effort_scale': [3.0, 1.0, 2.0]}
    Path('scaled.yaml').write_text(json.dumps({'recording': settings}))
    torques = []
    for config in (workshop.settings, 'scaled.yaml'):
        lip_id(
            'predict', workshop.model, workshop.bag, '-o', 'p.npz', '--config', config, '--force'
        )
        torques.append(np.std(read_npz('p.npz')[0]['tau_measured'], axis=0))
    np.testing.assert_allclose(torques[1], torques[0] * [1.0, 2.0, 3.0], rtol=0.1)


def test_predict_gives_the_parts_of_the_torque(workshop: Workshop, here: Path) -> None:
    lip_id('predict', workshop.model, workshop.other_bag, '-o', 'out.npz')

    arrays, _ = read_npz('out.npz')
    parts = sum(arrays[name] for name in ('inertial', 'coriolis', 'gravity', 'friction'))
    np.testing.assert_allclose(arrays['tau'], parts, atol=1e-9)
    assert np.all(arrays['tau_std'] > 0)


def test_dataset_keeps_joints_and_types(workshop: Workshop, here: Path, capsys: Capture) -> None:
    lip_id('dataset', workshop.bag, workshop.other_bag, '-o', 'data.npz', '--joints', 'wrist')

    data = Dataset.load('data.npz')
    assert data.joint_names == ('wrist',)
    assert set(data.segment.tolist()) == {0, 1}
    shown = capsys.readouterr().out
    assert 'uninterrupted segments: 2' in shown
    for values, unit in ((data.q, 'rad'), (data.dq, 'rad/s'), (data.tau, 'N m')):
        assert f' {values.min():.3g} to {values.max():.3g} {unit} ' in shown


@pytest.mark.slow
def test_fit_tells_flaws_of_recordings(workshop: Workshop, here: Path, capsys: Capture) -> None:
    broken = swing(0, rate=50.0)
    write_bag('broken', replace(broken, dq=57.3 * broken.dq), start=1.7e9)

    fit = ('fit', 'broken', '-o', 'arm.npz', '--config', workshop.settings)
    lip_id(*fit, '--kernel', 'recursive')

    text = ' '.join(capsys.readouterr().out.split())
    assert 'warning velocity_scale: the velocity of shoulder is 57.3 times' in text


def test_fit_learns_from_what_is_nearly_at_rest(workshop: Workshop, here: Path) -> None:
    lip_id('dataset', workshop.bag, '-o', 'data.npz', '--config', workshop.settings)

    data, model = Dataset.load('data.npz'), InverseDynamicsModel.load(workshop.model)
    slowest = 0.05 * np.sqrt(np.mean(np.square(data.dq), axis=0))
    assert (np.abs(data.dq) < slowest).any()
    assert model.n_samples == data.n_samples


def test_help_is_quick_and_names_every_verb() -> None:
    ran = subprocess.run(
        [sys.executable, '-X', 'importtime', '-m', 'lip_id_ros', '--help'],
        capture_output=True, text=True, check=True,
    )  # fmt: skip

    assert all(f'\n    {verb}' in ran.stdout for verb in VERBS)
    loaded = {
        line.rpartition('|')[2].strip().partition('.')[0] for line in ran.stderr.splitlines()
    }
    assert 'argparse' in loaded
    assert not loaded & {
        'numpy',
        'numba',
        'scipy',
        'matplotlib',
        'rosbags',
        'rich',
        'rclpy',
        'torch',
    }


@pytest.mark.slow
@pytest.mark.parametrize('verb', VERBS)
def test_every_verb_has_help_with_an_example(verb: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([verb, '--help'])

    assert stopped.value.code == 0
    assert f'lip_id {verb} ' in capsys.readouterr().out.split('example', 1)[1]


@pytest.mark.parametrize('streams', ['>&-', '2>&- >/dev/null', '>&- 2>&-'])
def test_closed_streams_end_no_verb(streams: str, here: Path) -> None:
    swing(1).save('data.npz')
    command = f'{sys.executable} -m lip_id_ros inspect data.npz {streams}'
    assert subprocess.run(command, shell=True, capture_output=True, check=True).stderr == b''


def test_a_terminal_of_few_characters_shows_escapes(here: Path) -> None:
    swing(1).save('gelenk_\xe4.npz')
    command = [sys.executable, '-m', 'lip_id_ros', 'inspect', 'gelenk_\xe4.npz']
    ascii_only = {**os.environ, 'PYTHONIOENCODING': 'ascii'}
    shown = subprocess.run(command, env=ascii_only, capture_output=True, check=True).stdout
    assert b'gelenk_\\xe4' in shown


@pytest.mark.slow
def test_an_output_is_replaced_by_its_kind_or_with_force(workshop: Workshop, here: Path) -> None:
    for _ in range(2):
        lip_id('dataset', workshop.bag, '-o', 'data.npz')
        lip_id('predict', workshop.model, workshop.bag, '-o', 'p.npz')
        lip_id('evaluate', workshop.model, workshop.bag, '--json', 'e.json', '--report', 'out')
    (here / 'letter.txt').write_text('Dear all')
    lip_id('evaluate', workshop.model, workshop.bag, '--json', 'letter.txt', '--force')
    assert 'nmse_percent' in json.loads((here / 'letter.txt').read_text())


def test_dataset_tells_rows_that_were_dropped(here: Path, capsys: Capture) -> None:
    t = np.arange(3000) / 100.0
    t[15:2985] = 15.0
    rows = np.column_stack([t, np.sin(t), np.sin(3.0 * t), np.cos(t), np.cos(3.0 * t)])
    np.savetxt('log.csv', rows, delimiter=',', header='t,q_a,q_b,tau_a,tau_b', comments='')
    lip_id('dataset', 'log.csv', '-o', 'data.npz')
    assert 'of 3000 messages cannot be used (stamp repeated: 2969)' in capsys.readouterr().out
