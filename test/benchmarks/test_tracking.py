"""The tracking experiment on two joints: what it claims, its figures, its report, its command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.tracking import (
    Experiment,
    Figures,
    figures,
    INFORMED,
    LEARNED,
    NOMINAL,
    run_experiment,
    Trial,
)
from benchmarks.tracking.experiment import recorded
from benchmarks.tracking.figures import FEEDBACK, notes, POSITION, RunFigures, tables
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings, PreprocessingSettings
from lip_id_ros.simulation import GrowingCosine
from lip_id_ros.simulation.torque_controlled import panda_setup, POSTURE, Setup

pytestmark = pytest.mark.slow

pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')

SMALL = Experiment(
    horizon=4.0,
    preprocessing=PreprocessingSettings(cutoff_hz=12.5, max_samples=120),
    fit=FitSettings(subset=60, iterations=15),
)


@pytest.fixture(scope='module')
def trial() -> Trial:
    return run_experiment(panda_setup(2), SMALL, 1)


def test_learned_feedforward_tracks_better_on_seen_and_unseen_amplitudes(trial: Trial) -> None:
    result = figures([trial])
    assert result.gains(POSITION, NOMINAL).min() > 5
    assert result.gains(FEEDBACK, NOMINAL).min() > 5
    assert {run.amplitude for run in result.runs} == {0.5, 0.6}
    assert all(error < 5 for error in result.kinetic_nmse_percent.values())
    assert all(error < 5 for error in result.potential_nmse_percent.values())


def test_runs_follow_the_papers_reference(trial: Trial) -> None:
    for (amplitude, _), run in trial.runs.items():
        reference = GrowingCosine(np.array(POSTURE[:2]), amplitude, SMALL.horizon)
        np.testing.assert_array_equal(run.reference[0], reference.sample(run.t)[0])
        assert run.t[-1] == pytest.approx(SMALL.horizon - 1e-3)
        assert np.abs(run.error).max() < 0.05


def test_the_learned_run_is_prepared_like_any_recording(trial: Trial) -> None:
    data = recorded(trial.runs[0.5, NOMINAL], panda_setup(2), SMALL)
    assert data.provenance['selected']['samples'] == 120
    assert trial.model.n_samples == data.n_samples == 120
    (source,) = data.provenance['sources']
    assert source['kept_every'] == pytest.approx(20, abs=1)
    assert source['filtered']


def test_figures_are_those_of_the_definitions(trial: Trial) -> None:
    run = trial.runs[0.6, LEARNED]
    (found,) = (
        each
        for each in figures([trial]).runs
        if (each.amplitude, each.feedforward) == (0.6, LEARNED)
    )
    reference = run.reference[0]
    squared = ((run.q - reference) ** 2).mean(axis=0)
    np.testing.assert_allclose(found.position_nmse_percent, 100 * squared / reference.var(axis=0))
    np.testing.assert_allclose(found.feedback_mean_square, (run.feedback**2).mean(axis=0))


def test_gains_are_taken_within_a_trial_and_the_least_is_named() -> None:
    def run(seed: int, feedforward: str, scale: float) -> RunFigures:
        return RunFigures(seed, 0.5, feedforward, (scale, 2 * scale), (scale, 3 * scale))

    runs = tuple(
        run(seed, name, scale)
        for seed, learned in ((0, 1.0), (1, 2.0))
        for name, scale in ((LEARNED, learned), (NOMINAL, 12.0), (INFORMED, 6.0))
    )
    of = Figures(('a', 'b'), runs, {(0, 0.5): 0.1, (1, 0.5): 0.2}, {(0, 0.5): 1.0, (1, 0.5): 2.0})

    np.testing.assert_allclose(of.gains(FEEDBACK, NOMINAL), [[12, 12], [6, 6]])
    content = of.to_json()
    assert content['least_position_gain'] == content['least_feedback_gain'] == 6
    assert content['runs'][3]['kinetic_nmse_percent'] == 0.2
    assert content['runs'][4]['kinetic_nmse_percent'] is None
    position, feedback = tables(of)
    assert position.rows[0] == (LEARNED, '1.5e+00', '3.0e+00')
    assert feedback.rows[2] == (INFORMED, '6.0e+00', '1.8e+01')
    assert 'position nMSE 6 to 12 (median 9), mean-square feedback 6 to 12' in notes(of)[1]
    assert notes(of)[2].startswith(INFORMED)


def test_the_command_writes_figures_pictures_and_page(
    trial: Trial,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    asked: list[tuple[Experiment, int]] = []

    def run(setup: Setup, experiment: Experiment, seed: int, progress: Progress) -> Trial:
        asked.append((experiment, seed))
        return trial

    monkeypatch.setattr('benchmarks.tracking.experiment.run_experiment', run)
    out, file = tmp_path / 'out', tmp_path / 'figures.json'

    assert main(['track', '-o', str(out), '--json', str(file)]) == 0

    assert asked == [(Experiment(), 0)]
    content = json.loads(file.read_text())
    assert content['joint_names'] == ['panda_joint1', 'panda_joint2']
    assert len(content['runs']) == 6
    names = ('positions', 'errors', 'feedback', 'energies')
    pictures = {f'{name}_{amplitude}.png' for name in names for amplitude in (0.5, 0.6)}
    assert {path.name for path in out.iterdir()} == pictures | {'index.html', 'model.npz'}
    page = (out / 'index.html').read_text()
    assert page.count('data:image/png;base64,') == 8
    assert 'masses wrong by up to 20 %' in page
    shown = capsys.readouterr().out
    assert 'Mean square of the feedback' in shown


@pytest.mark.parametrize('seeds', ['0', '-1', 'two', '1.5'])
def test_a_number_of_seeds_that_is_none(seeds: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(['track', '--seeds', seeds])
    assert f"expected a whole number above 0, got '{seeds}'" in capsys.readouterr().err
