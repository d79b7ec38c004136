"""Recordings to a judged model, the same wherever one begins."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulation.pendulums import swing

import lip_id_ros as lip
from lip_id_ros import identification
from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.evaluation import evaluate
from lip_id_ros.loading import examined, load_dataset
from lip_id_ros.preprocessing import for_training
from lip_id_ros.settings import Config, FitSettings, PreprocessingSettings
from lip_id_ros.simulation import write_bag
from lip_id_ros.workflow import fit as workflow
from lip_id_ros.workflow.fit import learn_from

QUICK = FitSettings(kernel='recursive', subset=25, max_samples=50, iterations=5)
FAST = PreprocessingSettings(min_velocity=0.2)
CONFIG = Config(preprocessing=FAST, fit=QUICK)


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('workflow') / 'run'
    write_bag(folder, swing(1, rate=50.0))
    return folder


def test_the_last_share_is_held_out_and_what_rests_is_judged_but_not_learned(bag: Path) -> None:
    learned = learn_from(bag, CONFIG, holdout=0.25)
    training, rest = load_dataset(bag, CONFIG).split(0.75)
    moving = for_training(training, FAST, QUICK.kernel)
    assert moving.n_samples < training.n_samples
    plain = identification.fit(moving, QUICK)
    states = rest.q, rest.dq, rest.ddq
    np.testing.assert_array_equal(learned.model.predict(*states).tau, plain.predict(*states).tau)
    assert learned.evaluation is not None
    assert learned.evaluation.to_json() == evaluate(plain, rest).to_json()
    assert 'held_out' in learned.model.summary
    assert any('samples of the same recording' in text for text in learned.cautions)


def test_preprocessing_is_selected_without_what_is_held_out(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shares = list[float]()

    def loaded(*arguments: Any) -> lip.Dataset:
        shares.append(arguments[-1])
        return examined.load_dataset(*arguments)

    monkeypatch.setattr(workflow, 'load_dataset', loaded)
    learn_from(bag, CONFIG, holdout=0.3)
    assert shares == [0.7]


def test_python_leaves_out_what_the_command_line_leaves_out(bag: Path) -> None:
    by_command = learn_from(bag, CONFIG).model
    in_python = lip.fit(lip.load_dataset(bag, CONFIG), QUICK)
    assert in_python.provenance['moving'] == by_command.provenance['moving']
    states = np.random.default_rng(0).normal(size=(3, 5, 3))
    np.testing.assert_array_equal(in_python.predict(*states).tau, by_command.predict(*states).tau)


def test_what_no_model_can_be_fitted_to_is_refused_before_samples_are_left_out() -> None:
    with pytest.raises(DataError, match='a fit needs a Dataset, not list'):
        lip.fit([])  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match='must be FitSettings, not dict'):
        lip.fit(swing(1), {})  # type: ignore[arg-type]
    data = swing(1)
    with pytest.raises(DataError, match='efforts that change were expected'):
        lip.fit(replace(data, tau=0.0 * data.tau))
