"""What is printed where, and how far long work is."""

from __future__ import annotations

from dataclasses import replace
import io
import json
from pathlib import Path
import re
from typing import Any

from cli.conftest import lip_id, Workshop
from gp.arms import dataset_of, noise_of, random_motion, TwoLinks
from model.models import random_model
import numpy as np
import pytest
from rich.console import Console
from simulation.pendulums import swing

from lip_id_ros.cli import main, output, show
from lip_id_ros.errors import DataError, one_line, printable
from lip_id_ros.evaluation import fit_cautions
from lip_id_ros.evaluation.report.page import for_page
from lip_id_ros.export.kinematics import model_kinematics
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.simulation import write_bag

Capture = pytest.CaptureFixture[str]


def test_json_is_written_whole(tmp_path: Path) -> None:
    output.write_json(str(tmp_path / 'a.json'), {'x': [1.5, None]})
    assert json.loads((tmp_path / 'a.json').read_text()) == {'x': [1.5, None]}


def test_json_that_would_not_be_json_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match='JSON'):
        output.write_json(str(tmp_path / 'a.json'), {'x': float('nan')})
    assert list(tmp_path.iterdir()) == []


def test_no_json_is_asked_for(capsys: Capture) -> None:
    output.write_json(None, {'x': 1})
    assert capsys.readouterr().out == ''


def test_every_stage_has_a_line_and_slow_ones_a_line_now_and_then() -> None:
    times = iter([0.0, 1.0, 2.0, 11.5, 11.6, 30.0, 31.0])
    stream = io.StringIO()
    lines = output.Lines(stream, clock=lambda: next(times))

    lines('fit', 1, 10)
    lines('fit', 2, 10)
    lines('fit', 3, 10)
    lines('reading', 0, 0)
    lines('reading', 0, 0)
    lines('fit', 3, 10)

    assert stream.getvalue() == 'fit\nfit: 3 of 10, 37 s left at most\nreading\n'


def test_the_rate_of_a_stage_that_begins_anew_is_that_of_the_new_pass() -> None:
    times = iter([0.0, 0.0, 20.0, 100.0, 120.0])
    stream = io.StringIO()
    lines = output.Lines(stream, clock=lambda: next(times))
    for done in (0, 10, 0, 5):
        lines('fit', done, 10)
    first = 'fit\nfit: 10 of 10, 0 s left at most\n'
    assert stream.getvalue() == first + 'fit: 0 of 10\nfit: 5 of 10, 20 s left at most\n'


def test_bars_are_shown_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = io.StringIO()
    monkeypatch.setattr(output, 'Console', lambda stderr: Console(file=shown, force_terminal=True))
    with output.progress_display() as progress:
        progress('reading', 0, 0)
        progress('hyperparameters', 3, 60)

    assert 'hyperparameters' in shown.getvalue()
    assert '3/60' in shown.getvalue()


def test_an_error_of_several_lines_becomes_one() -> None:
    assert one_line(DataError('first\n  second')) == 'first second'


def test_an_error_of_the_file_system_names_the_file() -> None:
    assert (
        one_line(FileNotFoundError(2, 'No such file', 'bag'))
        == 'bag: No such file; correct the path.'
    )
    assert one_line(OSError('disk full')) == 'disk full'


def test_outline_of_a_nested_description(capsys: Capture) -> None:
    description = {
        'kind': 'bag',
        'topics': [{'name': '/a', 'messages': 2}, {'name': '/b', 'messages': 0}],
        'dropped': {},
        'compressed': False,
        'timing': {'rate_hz': 125.000001, 'gaps': [], 'longest': None},
        'ranges': {'x': {'position': [-1.0, 2.5], 'velocity': None}},
    }

    show.described(description, Console(width=80))

    lines = capsys.readouterr().out.splitlines()
    assert lines[:5] == [
        'kind: bag',
        'topics 1 of 2: name /a, messages 2',
        'topics 2 of 2: name /b, messages 0',
        'compressed: no',
        'timing: rate_hz 125',
    ]
    assert any('-1 to 2.5' in line and 'absent' in line for line in lines)


def test_findings_of_one_kind_share_a_line(capsys: Capture) -> None:
    joints = {name: {'velocity_scale': 1.0, 'velocity_rms': None} for name in 'abc'}
    findings = [
        {'code': 'slow', 'severity': 'warning', 'joint': name, 'text': f'{name} is slow; hurry.'}
        for name in 'abc'
    ]
    health = {'findings': findings, 'joints': joints}

    show.described({'health': health}, Console(width=80))
    show.described({'health': {**health, 'findings': findings[:2]}}, Console(width=80))
    show.described({'health': {**health, 'findings': findings * 2}}, Console(width=80))
    show.described({'health': {**health, 'findings': []}}, Console(width=80))

    lines = capsys.readouterr().out.splitlines()
    said = [line for line in lines if 'slow' in line or 'no findings' in line]
    assert said == [
        'warning slow: a is slow; hurry. Likewise b, c.',
        'warning slow: a is slow; hurry.',
        'warning slow: b is slow; hurry.',
        'warning slow: a is slow; hurry. Likewise b, c. In all recordings: 6 times.',
        'no findings',
    ]


def test_hyperparameters_at_a_bound_are_a_caution(workshop: Workshop) -> None:
    model = InverseDynamicsModel.load(workshop.model)
    free = replace(model, summary={**model.summary, 'at_bounds': []})
    stuck = replace(model, summary={**model.summary, 'at_bounds': ['noise_variance[0]']})
    assert not any('ran to a bound' in text for text in fit_cautions(free))
    (found,) = (text for text in fit_cautions(stuck) if 'ran to a bound' in text)
    assert '1 hyperparameters ran to a bound (noise_variance[0])' in found


def test_an_indefinite_inertia_is_a_caution(workshop: Workshop) -> None:
    model = InverseDynamicsModel.load(workshop.model)
    good = replace(model, summary={**model.summary, 'inertia_not_pd_percent': 0.0})
    bad = replace(model, summary={**model.summary, 'inertia_not_pd_percent': 12.5})
    assert not any('inertia' in text for text in fit_cautions(good))
    (found,) = (text for text in fit_cautions(bad) if 'inertia' in text)
    assert 'is not positive definite at 12.5 % of the training samples' in found


SERVED = {
    'fit': 'serve refuses this model unless',
    'inspect': 'serve refuses this model unless',
    'evaluate': 'Do not serve this model: on this motion',
}


@pytest.mark.slow
def test_every_verb_warns_of_a_model_that_explains_nothing(
    workshop: Workshop, here: Path, capsys: Capture
) -> None:
    data = swing(1)
    noise = np.random.default_rng(0).normal(size=data.tau.shape)
    measured = replace(data, tau=noise, tau_noiseless=None, kinetic=None, potential=None)
    measured.save(here / 'noise.npz')
    fit = ('fit', 'noise.npz', '-o', 'm.npz', '--config', workshop.settings)
    for arguments in (fit, ('inspect', 'm.npz'), ('evaluate', 'm.npz', 'noise.npz')):
        capsys.readouterr()
        lip_id(*arguments)
        text = ' '.join(capsys.readouterr().out.split())
        assert 'predicts hardly better than the mean of the torque at ' in text, arguments
        assert SERVED[arguments[0]] in text, arguments


def test_distances_that_are_not_identified_are_marked(here: Path, capsys: Capture) -> None:
    model = random_model('articulated', types=('revolute',) * 3)
    std = {'twist_std_deg': [0.0] * 3, 'angle_std_deg': [0.0] * 3, 'offset_std_m': [0.0] * 3}
    kinematics = {**std, 'length_std_m': [0.0, 1e-3, 10.0]}
    summary = {**model.summary, 'denavit_hartenberg': kinematics}
    replace(model, summary=summary).save(here / 'm.npz')
    lip_id('inspect', 'm.npz', '--json', 'm.json')
    output = capsys.readouterr().out
    assert output.count('± 10.0000 ?') == 1
    assert output.count('± 0.0010 ') == 1
    assert '? marks a number that the data do not identify' in output
    found = json.loads((here / 'm.json').read_text())['kinematics']
    assert [each['not_identified'] for each in found.values()] == [[], [], ['length']]


@pytest.mark.parametrize('value', [5, 'text', None, [1], {'a': 1}])
def test_what_a_model_says_of_its_fit_is_shown_or_refused(
    workshop: Workshop, here: Path, capsys: Capture, value: object
) -> None:
    """With a hash that was computed anew."""
    model = InverseDynamicsModel.load(workshop.model)
    for name in ('summary', 'provenance'):
        for key, old in getattr(model, name).items():
            changed: dict[str, Any] = {name: {**getattr(model, name), key: value}}
            replace(model, **changed).save(here / 'm.npz')
            if main(['inspect', 'm.npz']) == 1:
                error = capsys.readouterr().err
                assert 'm.npz says it is a model but lacks or contradicts' in error, (key, old)


NAMES = ('arm[/red]left', 'a$\\frac{$', '\x1b[31m<b>wrist')


@pytest.fixture
def bag(here: Path) -> str:
    write_bag(here / 'bag', replace(swing(1, rate=50.0), joint_names=NAMES))
    return 'bag'


@pytest.mark.slow
def test_names_are_mere_data(workshop: Workshop, bag: str, here: Path, capsys: Capture) -> None:
    for arguments in (
        ('inspect', bag, '--report', 'health'),
        ('fit', bag, '-o', 'm.npz', '--config', str(workshop.settings)),
        ('inspect', 'm.npz'),
        ('evaluate', 'm.npz', bag, '--report', 'report'),
    ):
        capsys.readouterr()
        assert main(arguments) == 0, arguments
        text = capsys.readouterr().out
        assert all(printable(name) in text for name in NAMES), arguments
        assert '\x1b' not in text
    for page in (here / 'health', here / 'report'):
        html = (page / 'index.html').read_text(encoding='utf-8')
        assert all(for_page(name) in html.replace('<wbr>', '') for name in NAMES)
        assert '<b>wrist' not in html


def test_an_error_shows_names_without_their_effects(bag: str, capsys: Capture) -> None:
    assert main(['dataset', bag, '-o', 'a.npz', '--joints', 'none\x1b[2J']) == 1
    error = capsys.readouterr().err
    assert '\x1b' not in error
    assert r'\x1b[2J' in error


LENGTH = 1


def run(*arguments: str | Path) -> None:
    assert main([str(argument) for argument in arguments]) == 0


@pytest.mark.slow
def test_a_fit_tells_the_length_of_a_link(tmp_path: Path, capsys: Capture) -> None:
    """The planar arm has parallel axes, half a metre apart."""
    arm = TwoLinks(length=0.5)
    motion = random_motion(arm, 200, seed=4)
    tau = arm.torque(*motion)
    dataset_of(arm, motion, tau + noise_of(tau, 0.001)).save(tmp_path / 'arm.npz')
    run('fit', tmp_path / 'arm.npz', '-o', tmp_path / 'model.npz')
    output = ' '.join(capsys.readouterr().out.split())
    assert 'articulated kernel' in output
    assert re.search(r' 0\.(49[89]|50[01])\d ± 0\.0', output)
    assert 'a Gaussian process would not improve it' in output

    run('inspect', tmp_path / 'model.npz')
    output = ' '.join(capsys.readouterr().out.split())
    assert re.search(r' 0\.(49[89]|50[01])\d ± 0\.0', output)

    model = InverseDynamicsModel.load(tmp_path / 'model.npz')
    summary = {**model.summary, 'new_motion_s': 6.5}
    replace(model, summary=summary).save(tmp_path / 'short.npz')
    run('inspect', tmp_path / 'short.npz')
    output = ' '.join(capsys.readouterr().out.split())
    assert 'needs 12 s of motion without repetitions, and the recording has 6.5 s.' in output


def test_processes_beside_links_are_named(tmp_path: Path, capsys: Capture) -> None:
    random_model('articulated').save(tmp_path / 'model.npz')
    run('inspect', tmp_path / 'model.npz')
    output = ' '.join(capsys.readouterr().out.split())
    assert 'The model has Gaussian processes beside links and friction at joint_1' in output


@pytest.mark.slow
@pytest.mark.parametrize(('noise', 'identified'), [(0.001, True), (3.0, False)])
def test_noise_decides_what_is_identified(noise: float, identified: bool) -> None:
    arm = TwoLinks(length=0.5)
    motion = random_motion(arm, 200, seed=4)
    tau = arm.torque(*motion)
    model = fit(dataset_of(arm, motion, tau + noise_of(tau, noise)))
    kinematics = model_kinematics(model)
    assert kinematics is not None
    assert kinematics.identified[1, LENGTH] == identified
    if identified:
        length, std = kinematics.values[1, LENGTH], kinematics.std[1, LENGTH]
        assert length == pytest.approx(0.5, abs=3.0 * std)


@pytest.mark.slow
def test_a_selected_length_keeps_its_deviation() -> None:
    arm = TwoLinks(length=0.0)
    motion = random_motion(arm, 200, seed=4)
    tau = arm.torque(*motion)
    model = fit(dataset_of(arm, motion, tau + noise_of(tau, 0.001)))
    report = model.summary['denavit_hartenberg']
    assert report['length_std_m'][1] > 0.0
    assert '-0.0' not in [str(number) for numbers in report.values() for number in numbers]
