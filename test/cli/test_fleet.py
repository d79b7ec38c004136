from __future__ import annotations

from pathlib import Path
import shutil
from typing import Any

from cli.conftest import lip_id
import pytest
from simulation.pendulums import swing

from lip_id_ros.cli import main
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.simulation import write_bag

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope='module')
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('fleet')
    for seed in range(4):
        bag = folder / f'robot{seed % 2}' / f'run{seed}'
        bag.parent.mkdir(exist_ok=True)
        write_bag(bag, swing(seed, rate=50.0), start=1.7e9 + 100 * seed)
    damaged = folder / 'robot1' / 'empty'
    shutil.copytree(folder / 'robot1' / 'run1', damaged)
    next(damaged.glob('*.mcap')).write_bytes(b'')
    return folder


@pytest.mark.slow
def test_a_fleet_is_fitted_kept_and_reported(bags: Path, here: Path, capsys: Capture) -> None:
    command = [
        *('fit', str(bags), '-o', 'arm.npz', '--group-by', r'(robot\d)', '--cache', 'kept'),
        *('--report', 'fleet.html'),
    ]
    lip_id(*command)
    first = capsys.readouterr()
    assert '4 of 5 recordings' in first.out
    assert 'empty failed: ' in first.out
    assert 'Written: arm.npz' in first.out
    assert 'fit with --holdout, or evaluate' in first.out
    assert 'recordings read' in first.err
    page = Path('fleet.html').read_text()
    assert page.startswith('<!DOCTYPE html>')
    assert 'robot0' in page

    model = InverseDynamicsModel.load('arm.npz')
    for kind, count in (('survey', 4), ('statistics', 4), ('placements', 1), ('refusal', 1)):
        assert len(list(Path('kept').rglob(f'*.{kind}'))) == count
    lip_id(*command, '--jobs', '2')
    again = InverseDynamicsModel.load('arm.npz')
    assert model.arm is not None
    assert again.arm is not None
    assert (again.arm.links == model.arm.links).all()

    capsys.readouterr()
    lip_id(*command, '--jobs', '2', '--holdout', '0.4')
    held_out = capsys.readouterr().out
    assert 'Held out: the last 40 % of the samples' in held_out
    assert '3 of 5 recordings' in held_out
    assert 'run3 held out: the fit is judged by it' in held_out
    assert 'fitted on samples of the same recording' in held_out  # of which one was cut


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        (['--address', 'auto'], '--address names a Ray cluster, but the engine is local'),
        (['--engine', 'ray', '--address', 'auto', '--jobs', '2'], '--jobs is for engines on this'),
        (['--group-by', 'robot'], '--group-by must have one group in parentheses'),
        (['--jobs', '1000000000'], '--jobs must be at most '),
        (['--jobs', '2', '--report', './arm.npz'], 'arm.npz and ./arm.npz are one'),
        (['--jobs', '2', '--kernel', 'lip'], 'a fit recording by recording needs fit.kernel'),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    options: list[Any], message: str, bags: Path, here: Path, capsys: Capture
) -> None:
    assert main(['fit', str(bags), '-o', 'arm.npz', *options]) == 1
    assert message in capsys.readouterr().err
    assert not Path('arm.npz').exists()


@pytest.mark.parametrize('source', ['s3://bucket/arm7/', 'bags/**/*.mcap'])
def test_what_only_a_fleet_can_find_is_refused_without_its_options(
    source: str, here: Path, capsys: Capture
) -> None:
    assert main(['fit', source, '-o', 'arm.npz']) == 1
    message = f'{source} is a pattern or a URL; add --jobs 1, or name'
    assert message in ' '.join(capsys.readouterr().err.split())


def test_a_page_that_is_not_ours_is_not_replaced(bags: Path, here: Path, capsys: Capture) -> None:
    Path('mine.html').write_text('<p>mine</p>')
    assert main(['fit', str(bags), '-o', 'arm.npz', '--report', 'mine.html']) == 1
    assert 'mine.html exists and is not a report' in capsys.readouterr().err
    assert Path('mine.html').read_text() == '<p>mine</p>'
