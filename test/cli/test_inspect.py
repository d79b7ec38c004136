"""What `lip_id inspect` shows of recordings, data sets and models."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path

from cli.conftest import Capture, lip_id, Workshop
from identification.drives import recording
import pytest
from simulation.pendulums import swing

from lip_id_ros.cli import main
from lip_id_ros.recording.bag_writer import write_bag_folder
from lip_id_ros.simulation import write_bag


def test_inspect_says_what_is_wrong(workshop: Workshop, here: Path, capsys: Capture) -> None:
    broken = swing(0, rate=50.0)
    write_bag('broken', replace(broken, dq=57.3 * broken.dq), start=1.7e9)

    lip_id('inspect', 'broken', '--report', 'out', '--json', 'health.json')

    text = ' '.join(capsys.readouterr().out.split())
    (recording,) = json.loads((here / 'health.json').read_text())['recordings']
    scaled = [each for each in recording['health']['findings'] if each['code'] == 'velocity_scale']
    assert [finding['joint'] for finding in scaled] == ['shoulder', 'elbow', 'wrist']
    scale = recording['health']['joints']['elbow']['velocity_scale']
    assert scale == pytest.approx(57.3, rel=1e-2)
    assert 'warning velocity_scale: the velocity of shoulder is 57.3 times' in text
    assert 'Likewise elbow, wrist.' in text
    page = (here / 'out' / 'index.html').read_text(encoding='utf-8')
    assert 'the velocity of shoulder is 57.3 times' in page
    assert {path.name for path in (here / 'out').iterdir()} == {
        'index.html', 'signals.png', 'motion.png'
    }  # fmt: skip


def test_inspect_finds_out_what_efforts_are(here: Path, capsys: Capture) -> None:
    _, dataset = recording(0, [])
    dataset.save('sound.npz')
    replace(dataset, tau=-dataset.tau).save('turned.npz')

    lip_id('inspect', 'sound.npz', '--efforts')
    assert 'No other reading of the efforts' in capsys.readouterr().out

    lip_id('inspect', 'turned.npz', '--efforts', '--json', 'efforts.json')
    text = ' '.join(capsys.readouterr().out.split())
    (finding,) = json.loads((here / 'efforts.json').read_text())['efforts']
    assert finding['code'] == 'effort_sign'
    assert 'give these joints a negative value in recording.effort_scale.' in text


def test_only_recordings_can_be_drawn(here: Path, capsys: Capture) -> None:
    swing(0, rate=50.0).save('data.npz')

    assert main(['inspect', 'data.npz', '--report', 'out']) == 1

    assert capsys.readouterr().err == (
        'lip_id: error: --report needs a recording with joint samples, but data.npz has none; '
        'leave --report out, or evaluate a model with it.\n'
    )
    assert not (here / 'out').exists()


def test_inspect_tells_kinds_of_files(workshop: Workshop, here: Path, capsys: Capture) -> None:
    lip_id('dataset', workshop.bag, '-o', 'data.npz')
    capsys.readouterr()
    kinds = {}
    for path in (workshop.bag, 'data.npz', workshop.model):
        lip_id('inspect', path, '--json', '-')
        kinds[str(path)] = json.loads(capsys.readouterr().out)['kind']

    assert list(kinds.values()) == ['rosbag2 folder', 'data set', 'model']


def test_inspect_shows_rate_and_ranges(workshop: Workshop, capsys: Capture) -> None:
    lip_id('inspect', workshop.bag)

    output = capsys.readouterr().out
    assert 'rate_hz: 50' in output
    assert 'topic: /joint_states' in output
    assert all(name in output for name in ('shoulder', 'position', 'effort'))


def test_inspect_shows_what_a_model_was_fitted_on(workshop: Workshop, capsys: Capture) -> None:
    lip_id('inspect', workshop.model)

    output = capsys.readouterr().out
    assert 'kernel: articulated' in output
    assert f'source: {workshop.bag}' in output
    assert 'preprocessing: cutoff_hz 8\n' in output
    assert 'savitzky_golay' not in output  # a default
    assert 'viscous, Coulomb' in output


def test_a_bag_without_recordings_is_described(here: Path, capsys: Capture) -> None:
    write_bag_folder('bag', [])

    lip_id('inspect', 'bag')

    assert 'No topic has joint samples' in capsys.readouterr().out


@pytest.mark.parametrize('option', [('--report', 'out'), ('--efforts',), ('--config', 'a.yaml')])
def test_options_of_recordings_are_refused_for_models(
    option: tuple[str, ...], workshop: Workshop, here: Path, capsys: Capture
) -> None:
    assert main(['inspect', str(workshop.model), *option]) == 1
    assert f'{option[0]} is about recordings, but ' in capsys.readouterr().err
