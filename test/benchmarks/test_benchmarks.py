"""The benchmarks run, in their smallest form: what they measure is not judged here."""

from __future__ import annotations

import json
from pathlib import Path
import subprocess
import sys

from evaluation.models import small_model
import numpy as np
import pytest

from benchmarks import deviations, panda_monte_carlo, real_arms
from benchmarks.__main__ import available, main
from benchmarks._results import Row
from benchmarks.query import ALLOWED_BLOCKS

pytestmark = pytest.mark.slow

pytest.importorskip('pinocchio', reason='the simulated arm needs pinocchio')

ROOT = Path(__file__).resolve().parents[2]

SMALL = ['--joints', '3', '--models', 'recursive', '--set', 'subset=30', 'iterations=3']


def test_finished_cells_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results = tmp_path / 'results.json'
    assert main(['panda_monte_carlo', *SMALL, '--seeds', '0', '--results', str(results)]) == 0
    (first,) = json.loads(results.read_text()).values()
    assert len(first['nmse_percent']) == 3
    assert '3 joints, medians of 1 seeds' in capsys.readouterr().out
    assert main(['panda_monte_carlo', *SMALL, '--seeds', '0', '1', '--results', str(results)]) == 0
    cells = json.loads(results.read_text())
    assert len(cells) == 2
    assert first in cells.values()


def test_summary_compares_medians_with_the_first_model() -> None:
    def row(*errors: float) -> Row:
        energies = ('kinetic_nmse_percent', 'potential_nmse_percent', 'inertia_not_pd_percent')
        return {'nmse_percent': list(errors), 'cpu_s': 1.0, **dict.fromkeys(energies, None)}

    chosen = {
        'lip': [row(1.0, 4.0), row(2.0, 8.0), row(9.0, 9.0)],
        'recursive': [row(0.5, 0.5), row(1.0, 2.0), row(1.0, 3.0)],
    }
    table = panda_monte_carlo.summarise(2, chosen)
    (*_, ratios) = table.columns
    expected = np.sqrt(1.0 / 2.0 * 2.0 / 8.0)
    assert list(ratios.cells) == ['1', f'{expected:.2g}']


def test_rows_of_real_arms_are_those_of_the_pages() -> None:
    rows: dict[str, Row] = {
        'UR10, last | articulated': {
            'nmse': [1.0, 4.0],
            'spread': [1.9, 2.2],
            'coverage': [95.4, 100.0],
            'cpu_s': 9.7,
        },
        'UR10, last | rigid_body': {'nmse': [2.0, 4.0]},
        'UR10, last | gip': {'nmse': [2.0, 2.0]},
        'UR10, last | lip': {'nmse': [2.0, 8.0]},
        'UR10, first | rigid_body': {'error': 'of no use'},
    }
    assert list(real_arms.accuracy(rows)) == [
        '| UR10, last 30 % | 1 4 | 2.5 | 2 | 1.9 to 2.2 | 95 100 | 10 |'
    ]
    assert list(real_arms.known_kinematics(rows)) == [
        '| UR10, last | 2.5 | 2 | 3 | 2.8 | 0.71 |',
        '| all joints | rigid_body | 0.71 |',
    ]
    assert list(real_arms.plain(rows)) == ['| UR10, last | 2.5 |  | 2 | 5 |  | 1.25 |']


def test_true_deviations_are_as_large_as_few_errors() -> None:
    errors = np.random.default_rng(0).standard_normal((20_000, 3))
    ratios = 1.0 / np.sqrt(np.mean(errors**2, axis=1, keepdims=True))
    assert np.mean(ratios) == pytest.approx(1.38, abs=0.02)
    assert deviations.pooled(ratios)[0] == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize('name', available())
def test_each_explains_its_options(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    if name == 'fuzz_nodes':
        pytest.importorskip('rclpy')
    with pytest.raises(SystemExit, match='0'):
        main([name, '--help'])
    assert f'usage: benchmarks {name}' in capsys.readouterr().out


def test_all_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['--help']) == 0
    shown = capsys.readouterr().out
    assert all(f'\n  {name} ' in shown for name in available())


def test_queries_leave_nothing_in_memory(tmp_path: Path) -> None:
    model, figures = tmp_path / 'model.npz', tmp_path / 'figures.json'
    small_model().save(model)
    arguments = ['--model', str(model), '--calls', '3000', '--json', str(figures)]
    # in a process of its own: threads that other tests have left take memory as well
    command = [sys.executable, '-m', 'benchmarks', 'query', *arguments]
    subprocess.run(command, check=True, cwd=ROOT)
    first, *others = json.loads(figures.read_text())
    assert first['calls'] == 3000
    assert first['blocks'] <= ALLOWED_BLOCKS  # one a call would be 3000
    assert all(row['ratio'] > 0 and 1 <= row['p99'] <= row['p999'] for row in (first, *others))
