"""What is wrong with a recording reaches the cautions of a fit in Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from evaluation.models import small_model
import numpy as np
from simulation.pendulums import swing

import lip_id_ros as lip
from lip_id_ros.dataset import Dataset
from lip_id_ros.recording import JointSamples
from lip_id_ros.simulation import write_bag


def cautions(data: Dataset) -> list[str]:
    return lip.fit_cautions(replace(small_model(), provenance=data.provenance))


def test_findings_are_cautions_of_a_model_that_was_learned_from_it(tmp_path: Path) -> None:
    data = swing(1, rate=50.0)
    write_bag(tmp_path / 'copied', replace(data, tau=np.repeat(data.tau[:, :1], 3, axis=1)))
    seen: list[JointSamples] = []
    loaded = lip.load_dataset(tmp_path / 'copied', watch=seen.append)
    assert len(seen) == 1
    assert any(each.startswith('error effort_copied: ') for each in cautions(loaded))


def test_short_recordings_are_a_caution_where_there_is_only_one(tmp_path: Path) -> None:
    for seed in (1, 2):
        write_bag(tmp_path / f'{seed}', swing(seed, rate=50.0))
    paths = [tmp_path / '1', tmp_path / '2']
    one, both = (cautions(lip.load_dataset(some)) for some in (paths[:1], paths))
    assert any('warning short' in each for each in one)
    assert not any('warning short' in each for each in both)
