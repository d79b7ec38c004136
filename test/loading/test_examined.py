"""What is wrong with a recording reaches the cautions of a fit in Python."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from evaluation.models import small_model
import numpy as np
from simulation.pendulums import swing

import lip_id_ros as lip
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.simulation import write_bag


def cautions(data: Dataset) -> list[str]:
    return lip.fit_cautions(replace(small_model(), provenance=data.provenance))


def test_findings_are_cautions_of_a_model_that_was_learned_from_it(tmp_path: Path) -> None:
    data = swing(1, rate=50.0)
    write_bag(tmp_path / 'copied', replace(data, tau=np.repeat(data.tau[:, :1], 3, axis=1)))
    loaded = lip.load_dataset(tmp_path / 'copied')
    assert any(each.startswith('error effort_copied: ') for each in cautions(loaded))


def test_findings_stay_with_their_recording_wherever_it_goes(tmp_path: Path) -> None:
    data = swing(1, rate=50.0)
    write_bag(tmp_path / 'copied', replace(data, tau=np.repeat(data.tau[:, :1], 3, axis=1)))
    write_bag(tmp_path / 'sound', swing(2, rate=50.0))
    sound, copied = (lip.load_dataset(tmp_path / name) for name in ('sound', 'copied'))
    copied.select(range(50)).save(tmp_path / 'part.npz')
    joined = concatenate([sound, Dataset.load(tmp_path / 'part.npz')])
    (found,) = (each for each in cautions(joined) if 'effort_copied' in each)
    assert found.endswith(f'In {tmp_path / "copied"}.')
    together = lip.load_dataset([tmp_path / 'sound', tmp_path / 'copied'])
    assert found in cautions(together)


def test_short_recordings_are_a_caution_where_they_are_short_together(tmp_path: Path) -> None:
    paths = [tmp_path / f'{seed}' for seed in range(4)]
    for seed, path in enumerate(paths):
        write_bag(path, swing(seed, rate=50.0))
    some, all_of_them = (cautions(lip.load_dataset(each)) for each in (paths[:2], paths))
    assert any('warning short' in each for each in some)
    assert not any('warning short' in each for each in all_of_them)
