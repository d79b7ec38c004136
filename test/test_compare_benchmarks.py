"""The data of the paper's comparisons, and that an experiment runs in its smallest form."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('pinocchio', reason='the simulated arm needs pinocchio')

from benchmarks import _experiments
from benchmarks.__main__ import main
from benchmarks._effects import ArmWithEffects, JointEffects, PANDA_EFFECTS
from benchmarks._experiments import EXPERIMENTS, Form
from benchmarks._panda import run_pair
from lip_id_ros.baselines import MODELS
from lip_id_ros.config import FitSettings
from lip_id_ros.simulation import panda

RNG = np.random.default_rng(0)


def test_power_of_the_effects_is_stored_in_rotors_or_lost() -> None:
    q, dq, ddq = RNG.standard_normal((3, 200, 7))
    without_ripple = JointEffects(**{**vars(PANDA_EFFECTS), 'ripple': np.zeros(7)})
    lost = dq * (without_ripple.torque(q, dq, ddq) - PANDA_EFFECTS.rotor * ddq)
    assert lost.min() >= 0
    bare = panda(7)
    arm = ArmWithEffects(bare, PANDA_EFFECTS)
    rotors = arm.kinetic(q, dq) - bare.kinetic(q, dq)
    np.testing.assert_allclose(rotors, 0.5 * np.square(dq) @ PANDA_EFFECTS.rotor)


def test_friction_grows_towards_rest_and_ends_there() -> None:
    speeds = np.array([0.0, 0.02, 0.5])[:, None] * np.ones(7)
    at = PANDA_EFFECTS.torque(0 * speeds, speeds, 0 * speeds)
    assert np.all(at[0] == 0)
    assert np.all(at[1] > PANDA_EFFECTS.coulomb + PANDA_EFFECTS.viscous * speeds[1])
    expected = PANDA_EFFECTS.coulomb + PANDA_EFFECTS.viscous * speeds[2]
    np.testing.assert_allclose(at[2], expected, rtol=1e-6)


def test_unseen_motions_with_friction_reach_farther_and_are_measured() -> None:
    (case,) = _experiments.friction(2, 1, 1)
    (unseen,) = case.tests.values()
    assert np.all(np.ptp(unseen.q, axis=0) > 1.5 * np.ptp(case.train.q, axis=0))
    assert unseen.tau_noiseless is not None
    noise = (unseen.tau - unseen.tau_noiseless).std(axis=0)
    assert np.all(noise > 0)
    assert np.all(noise < 0.2 * unseen.tau.std(axis=0))


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
    form = Form(
        lambda: _experiments.friction(2, 1, 2), ('recursive', 'rigid_body'), FitSettings(subset=40)
    )
    monkeypatch.setitem(EXPERIMENTS, 'friction', (form, form))
    assert main(['compare', 'friction', '-o', str(tmp_path)]) == 0
    assert 'median of 2 unseen motions' in capsys.readouterr().out
    cells = {path: path.stat().st_mtime_ns for path in tmp_path.glob('cells_*/*')}
    assert len(cells) == 2
    assert main(['compare', 'friction', '-o', str(tmp_path)]) == 0
    assert cells == {path: path.stat().st_mtime_ns for path in tmp_path.glob('cells_*/*')}
    found = json.loads((tmp_path / 'comparison.json').read_text())['groups']
    medians = found['2 joints with friction']
    assert all(medians[model]['nmse_percent_mean'] < 20 for model in form.models)
