"""The data of the paper's comparisons, and that an experiment runs in its smallest form."""

from __future__ import annotations

from dataclasses import replace
import json
from pathlib import Path
import re

import numpy as np
import pytest

pytest.importorskip('pinocchio', reason='the simulated arm needs pinocchio')

from benchmarks import _experiments
from benchmarks.__main__ import main
from benchmarks._effects import driven, Drives, INDUSTRIAL, MILD
from benchmarks._experiments import EXPERIMENTS, Form, settings_of_friction
from benchmarks._panda import run_pair
from benchmarks.baselines import MODELS
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation import panda, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION

pytestmark = pytest.mark.slow

RNG = np.random.default_rng(0)


ARMS = pytest.mark.parametrize('drives', [MILD, INDUSTRIAL], ids=['mild', 'industrial'])


@ARMS
def test_friction_takes_power(drives: Drives) -> None:
    q, dq, load = RNG.standard_normal((3, 200, 7))
    assert (dq * drives.friction(q, dq, 20 * load)).min() >= 0


@ARMS
def test_friction_grows_towards_rest_and_ends_there(drives: Drives) -> None:
    even = replace(drives, uneven=np.zeros(7))
    speeds = np.array([0.0, 0.02, 0.8])[:, None] * np.ones(7)
    load = np.full((3, 7), -10.0)
    at = even.friction(speeds, speeds, load)
    dry = even.coulomb + 10.0 * even.load_coulomb
    assert np.all(at[0] == 0)
    assert np.all(at[1] > dry + even.viscous * speeds[1])
    np.testing.assert_allclose(at[2], dry + even.viscous * speeds[2], rtol=1e-6)


def test_only_viscous_friction_drifts_and_no_farther_than_it_may() -> None:
    warm = INDUSTRIAL.at_some_temperature(np.random.default_rng(0))
    change = warm.viscous / INDUSTRIAL.viscous - 1.0
    assert np.all(np.abs(change) <= INDUSTRIAL.drift)
    assert np.all(change != 0)
    np.testing.assert_array_equal(warm.coulomb, INDUSTRIAL.coulomb)


def test_motors_run_ahead_of_their_links_by_what_the_gears_bend() -> None:
    """And their motion is that of their positions."""
    arm, step = panda(2), 1e-3
    known = SinusoidTrajectory.random(MOTION.first(2), np.random.default_rng(0), 20)
    link = known.sample(np.arange(0.0, known.period, step))
    drives = INDUSTRIAL.first(2)
    run = driven(arm, drives, link, step)
    load = arm.inverse_dynamics(*link)
    np.testing.assert_allclose(run.motor[0] - link[0], load / drives.stiffness, atol=1e-12)
    for x, rate in zip(run.motor, run.motor[1:], strict=False):
        middle = (x[2:] - x[:-2]) / (2 * step)
        np.testing.assert_allclose(middle, rate[1:-1], atol=1e-4 * np.abs(rate).max())
    stiff = driven(arm, replace(drives, stiffness=np.full(2, np.inf)), link, step)
    np.testing.assert_array_equal(stiff.motor[0], link[0])
    rotors = 0.5 * np.square(run.motor[1]) @ drives.rotor
    np.testing.assert_allclose(run.kinetic - arm.kinetic(link[0], link[1]), rotors, atol=1e-9)


def test_unseen_motions_with_friction_reach_as_far_as_said_and_are_measured() -> None:
    cases = list(_experiments.friction(2, 1, 1))
    assert len(cases) == len(settings_of_friction())
    for case, setting in zip(cases, settings_of_friction(), strict=True):
        (unseen,) = case.tests.values()
        farther = np.ptp(unseen.q, axis=0) / np.ptp(case.train.q, axis=0)
        assert np.all((farther > 0.75 * setting.farther) & (farther < 1.35 * setting.farther))
        assert unseen.tau_noiseless is not None
        noise = (unseen.tau - unseen.tau_noiseless).std(axis=0)
        assert np.all(noise > 0)
        assert np.all(noise < 0.3 * unseen.tau.std(axis=0))


def test_a_real_arm_knows_no_true_torques() -> None:
    cases = list(_experiments.friction(1, 1, 1))
    for case, judged in zip(cases, _experiments.by_measured(cases), strict=True):
        (truth,), (unseen,) = case.tests.values(), judged.tests.values()
        assert unseen.tau_noiseless is None
        np.testing.assert_array_equal(unseen.tau, truth.tau)


def test_the_page_names_every_experiment() -> None:
    page = (Path(__file__).parents[2] / 'docs' / 'explanation' / 'comparison.md').read_text()
    assert set(re.findall(r'benchmarks compare (\w+)', page)) == set(EXPERIMENTS)


@pytest.mark.parametrize('name', sorted(EXPERIMENTS))
def test_forms_name_models_that_exist(name: str) -> None:
    for form in EXPERIMENTS[name]:
        assert set(form.models) <= set(MODELS)


def test_data_efficiency_thins_one_run() -> None:
    few, more = _experiments.data_efficiency(2, (50, 100), 1)
    assert (few.train.n_samples, more.train.n_samples) == (50, 100)
    assert set(few.train.t) <= set(thinned_times())
    np.testing.assert_array_equal(few.tests['unseen motion'].q, more.tests['unseen motion'].q)


def thinned_times() -> list[float]:
    times: list[float] = run_pair(2, 0)[0].t.tolist()
    return times


def test_an_experiment_runs_and_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    small = list(_experiments.friction(2, 1, 2))[-1]
    form = Form(lambda: iter([small]), ('recursive', 'rigid_body'), FitSettings(subset=40))
    monkeypatch.setitem(EXPERIMENTS, 'friction', (form, form))
    assert main(['compare', 'friction', '-o', str(tmp_path)]) == 0
    assert 'median of 2 unseen motions' in capsys.readouterr().out
    cells = {path: path.stat().st_mtime_ns for path in tmp_path.glob('cells_*/*')}
    assert len(cells) == 2
    assert main(['compare', 'friction', '-o', str(tmp_path)]) == 0
    assert cells == {path: path.stat().st_mtime_ns for path in tmp_path.glob('cells_*/*')}
    found = json.loads((tmp_path / 'comparison.json').read_text())['groups']
    medians = found['small effects, 2.4 times as far']
    assert all(medians[model]['nmse_percent_mean'] < 20 for model in form.models)
