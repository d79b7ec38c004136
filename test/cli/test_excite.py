"""The verb that designs a motion."""

from __future__ import annotations

from pathlib import Path
import re

from cli.conftest import Capture, lip_id
from excitation.cases import ARM
from excitation.test_next_motion import model
import pytest

from lip_id_ros.cli import main
from lip_id_ros.excitation.settings import ExcitationConfig
from lip_id_ros.settings import example_yaml, read_sections

ROOT = Path(__file__).resolve().parents[2]
QUICK = """motion: {duration_s: 2, torque_limits: [10000]}
space: {radius_m: 0.03}
search: {draws: 3}
"""


@pytest.fixture
def files(here: Path) -> Path:
    (here / 'arm.urdf').write_text(ARM)
    (here / 'excite.yaml').write_text(QUICK)
    return here


def test_a_motion_is_designed_written_and_shown(files: Path, capsys: Capture) -> None:
    lip_id(
        *('excite', '--urdf', 'arm.urdf', '--config', 'excite.yaml'),
        *('-o', 'motion.yaml', '-o', 'motion.csv', '--seed', 3, '--joints', 'turn,lift'),
    )
    output = capsys.readouterr()
    assert 'turn [rad]' in output.out
    assert 'slide' not in output.out
    said = ' '.join(output.out.split())
    assert 'Lowest point: b, 0.' in said
    assert 'm above the base plane. Farthest point: b, 0.' in said
    assert 'Fastest joint: ' in said
    assert 'Best of 3 random motions: the expected squared error of torques after it is 0.' in said
    assert 'Written: motion.csv' in output.out
    assert output.err.splitlines()[0] == 'design'
    assert len((files / 'motion.csv').read_text().splitlines()) == 202
    # what it wrote itself, it may write again
    lip_id('excite', '--urdf', 'arm.urdf', '--config', 'excite.yaml', '-o', 'motion.csv')
    assert 'q_slide' in (files / 'motion.csv').read_text()


def test_outputs_are_checked_before_the_work(files: Path, capsys: Capture) -> None:
    begin = ['excite', '--urdf', 'arm.urdf', '-o']
    assert main([*begin, 'arm.urdf']) == 1
    assert 'arm.urdf is an input and would be replaced' in capsys.readouterr().err
    (files / 'notes.yaml').write_text('mine')
    assert main([*begin, 'notes.yaml']) == 1
    assert 'notes.yaml exists and is not a motion' in capsys.readouterr().err
    assert main([*begin, 'motion.txt']) == 1
    assert 'motion.txt ends otherwise' in capsys.readouterr().err
    assert main([*begin, 'm.csv', '-o', 'm.csv']) == 1
    assert 'every output needs a file of its own' in capsys.readouterr().err
    assert not list(files.glob('m*'))


def test_a_demand_that_leaves_no_motion_gets_a_sentence(files: Path, capsys: Capture) -> None:
    (files / 'excite.yaml').write_text('motion: {posture: [0, 3, 0.2]}')
    arguments = ['excite', '--urdf', 'arm.urdf', '--config', 'excite.yaml', '-o', 'm.yaml']
    assert main(arguments) == 1
    assert capsys.readouterr().err == (
        "lip_id: error: the posture of joint 'lift' must be between its position limits -0.85 and "
        '1.85, and 0.0027 from each, but is 3; move it, or widen motion.lower and motion.upper.\n'
    )


def test_without_a_urdf_the_settings_need_what_the_page_names(
    files: Path, capsys: Capture
) -> None:
    page = ' '.join((ROOT / 'docs/reference/excitation.md').read_text().split())
    _, _, named = page.partition('Without a URDF, `excite.yaml` must name ')
    values = {'joints': '[a]', 'lower': '[-1]', 'upper': '[1]', 'velocity': '[1]'}
    assert re.findall(r'`motion\.(\w+)`', named.partition('. ')[0]) == list(values)
    for missing in (None, *values):
        given = ', '.join(f'{key}: {value}' for key, value in values.items() if key != missing)
        (files / 'excite.yaml').write_text(QUICK.replace('motion: {', f'motion: {{{given}, '))
        status = main(['excite', '--config', 'excite.yaml', '-o', 'm.csv', '--force'])
        said = capsys.readouterr().err
        assert (status, f'motion.{missing} ' in said) == ((1, True) if missing else (0, False))


def test_after_a_model_it_shows_what_was_unknown_and_will_be(files: Path, capsys: Capture) -> None:
    model().save(files / 'arm.npz')
    begin = ('excite', '--urdf', 'arm.urdf', '--config', 'excite.yaml')
    lip_id(*begin, '--after', 'arm.npz', '-o', 'next.csv', '--report', 'page')
    shown = capsys.readouterr().out
    assert 'Standard deviations where torques are wanted' in shown
    assert 'slide [N]' in shown
    assert 'deviation before' in shown
    assert 'Coulomb' in shown
    assert (files / 'next.csv').exists()
    assert {path.name for path in (files / 'page').iterdir()} == {'index.html', 'motion.png'}
    page = (files / 'page' / 'index.html').read_text()
    assert page.count('<img') == 1
    assert 'Lowest point: ' in page
    assert 'deviation before' in page

    assert main([*begin, '--targets', 'next.csv', '-o', 'other.csv']) == 1
    assert '--targets needs a model' in capsys.readouterr().err


def test_the_file_of_settings_is_current() -> None:
    path = ROOT / 'config' / 'excite.yaml'
    assert path.read_text() == example_yaml(ExcitationConfig(), 'the design of a motion')
    assert read_sections(path, ExcitationConfig()) == ExcitationConfig()
