"""The benchmarks run, in their smallest form: what they measure is not judged here."""

from __future__ import annotations

import json
from pathlib import Path
import re
import subprocess
import sys

from evaluation.models import small_model
import numpy as np
from programs import installed
import pytest
from ros_domain import free_domain

from benchmarks import (
    deviations,
    panda_monte_carlo,
    real_arms,
    track_controller,
)
from benchmarks.__main__ import available, main
from benchmarks._results import Results, Row
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


def test_nothing_is_measured_twice(tmp_path: Path) -> None:
    counted: list[int] = []

    def measure() -> Row:
        counted.append(1)
        return {'value': 0.5}

    for _ in range(2):
        assert Results(tmp_path / 'results.json').row('a', measure) == {'value': 0.5}
    assert len(counted) == 1


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


def test_a_page_has_the_result_of_every_benchmark() -> None:
    root = Path(__file__).parents[2]
    pages = [page.read_text() for page in (*root.glob('*.md'), *root.glob('docs/**/*.md'))]
    named = set(re.findall(r'benchmarks\s+(\w+)', ' '.join(pages)))
    assert sorted(set(available()) - named) == []


@pytest.mark.ros
@pytest.mark.ros2_control
def test_an_arm_behind_a_controller_is_learned_and_tracked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if installed('controller_manager', 'ros2_control_node') is None:
        pytest.skip('needs a controller manager; with g++ make setup compiles it')
    figures = tmp_path / 'figures.json'
    arguments = ['--horizon', '4', '--amplitudes', '0.5', '--json', str(figures)]
    with free_domain() as domain:
        monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
        assert main(['track_controller', *arguments]) == 0
    rows = {row['feedforward']: row for row in json.loads(figures.read_text())}
    nominal, learned = (
        np.array(rows[name]['feedback_mean_square'])
        for name in (track_controller.NOMINAL, track_controller.LEARNED)
    )
    assert np.exp(np.log(learned / nominal).mean()) < 0.3


def test_the_reference_is_the_papers_and_begins_and_ends_at_rest() -> None:
    amplitude, horizon, ease = 0.6, 10.0, track_controller.EASE_S
    t, (q, dq, ddq) = track_controller.reference(amplitude, horizon)
    since = t - ease
    within = (since >= 0.0) & (since <= horizon)
    swing = amplitude / horizon * since * np.cos(np.pi * since)
    expected = track_controller.POSTURE + swing[:, None]
    np.testing.assert_allclose(q[within], expected[within], atol=1e-12)
    np.testing.assert_allclose(dq[-1], 0.0, atol=1e-12)
    np.testing.assert_allclose(dq[0], 0.0, atol=1e-3)
    np.testing.assert_allclose(np.gradient(q, t, axis=0)[1:-1], dq[1:-1], atol=2e-3)
    np.testing.assert_allclose(np.gradient(dq, t, axis=0)[1:-1], ddq[1:-1], atol=0.2)


def test_a_nominal_model_is_wrong_in_its_masses_and_knows_no_friction() -> None:
    known, arm = track_controller.feedforwards(0), track_controller.true_arm()
    q, still = track_controller.POSTURE[None], np.zeros((1, 7))
    moving = np.full((1, 7), 0.5)
    true = arm.torque(q, still, still)
    np.testing.assert_allclose(known[track_controller.KDL](q, still, still), true, atol=1e-9)
    off = np.abs(known[track_controller.NOMINAL](q, still, still) - true)
    assert 0.3 < off.max() < 10.0
    rubbing = known[track_controller.INFORMED](q, moving, still)
    rubbing -= known[track_controller.NOMINAL](q, moving, still)
    sign = np.tanh(0.5 / track_controller.SIGN_WIDTH)
    np.testing.assert_allclose(rubbing, track_controller.FRICTION * (0.5 + sign), atol=1e-9)


def test_unknown_benchmark(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['panda']) == 2
    assert ', '.join(available()) in capsys.readouterr().err


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
