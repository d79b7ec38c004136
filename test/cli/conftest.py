"""Recordings of three pendulums, and a model fitted on one of them through the command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from made_once import made_once
import pytest
from simulation.pendulums import swing

from lip_id_ros.cli import main
from lip_id_ros.simulation import write_bag

Capture = pytest.CaptureFixture[str]

SETTINGS = """
preprocessing:
  cutoff_hz: 8.0
fit:
  subset: 25
  max_samples: 50
  iterations: 8
"""


def lip_id(*arguments: object) -> None:
    assert main([str(argument) for argument in arguments]) == 0


@dataclass(frozen=True)
class Workshop:
    bag: Path
    other_bag: Path
    settings: Path
    model: Path


@pytest.fixture(scope='session')
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return workshop_in(made_once(tmp_path_factory, 'workshop', furnish))


def workshop_in(folder: Path) -> Workshop:
    return Workshop(folder / 'run', folder / 'other', folder / 'arm.yaml', folder / 'arm.npz')


def furnish(folder: Path) -> None:
    folder.mkdir()
    files = workshop_in(folder)
    for seed, bag in enumerate((files.bag, files.other_bag)):
        write_bag(bag, swing(seed, rate=50.0), start=1.7e9)
    files.settings.write_text(SETTINGS)
    lip_id('fit', files.bag, '-o', files.model, '--config', files.settings)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path
