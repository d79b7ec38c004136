"""Recordings with another load at the last link are told from the others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fleet.fleets import arm_of, friction_of, linearisation_of, PlainEngine, recording, save
from gp.chains import ChainArm
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import fit_cautions
from lip_id_ros.fleet.consistency import disagreement
from lip_id_ros.fleet.fit import fit_fleet
from lip_id_ros.fleet.placements import contradictions
from lip_id_ros.fleet.survey import survey_of
from lip_id_ros.settings import Config

ARM = arm_of()

Groups = tuple[list[str], list[str]] | None


def with_load(arm: ChainArm, mass: float) -> ChainArm:
    """Return an arm that carries a ball 0.1 m from the frame of its last link."""
    links, lever = arm.parameters.copy(), np.array([0.03, -0.02, 0.09])
    inertia = mass * ((0.0016 + lever @ lever) * np.eye(3) - np.outer(lever, lever))
    links[-1, :10] += np.array([mass, *mass * lever, *inertia[np.triu_indices(3)]])
    return replace(arm, parameters=links)


def recordings(masses: list[float], seed: int, noise: float = 0.02) -> list[Dataset]:
    """Return recordings with loads [kg] and friction of their own."""
    rng = np.random.default_rng(seed)
    return [
        recording(with_load(ARM, mass), friction_of(ARM, rng, 0.1), 100 * seed + k, noise=noise)
        for k, mass in enumerate(masses)
    ]


def judged(data: list[Dataset]) -> Groups:
    surveys = [survey_of(each, f'r{k}', '') for k, each in enumerate(data)]
    return disagreement(surveys, linearisation_of(ARM, data[0]))


@settings(max_examples=8)
@given(
    loaded=st.lists(st.booleans(), min_size=2, max_size=8).filter(lambda x: 0 < sum(x) < len(x)),
    mass=st.floats(0.3, 6.0),
    seed=st.integers(0, 50),
)
def test_a_load_in_some_recordings_is_found(loaded: list[bool], mass: float, seed: int) -> None:
    groups = judged(recordings([mass * each for each in loaded], seed))
    assert groups is not None
    names = [[f'r{k}' for k, each in enumerate(loaded) if each == side] for side in (True, False)]
    assert sorted(groups) == sorted(names)
    assert len(groups[0]) <= len(groups[1])


@settings(max_examples=8)
@given(count=st.integers(1, 8), noise=st.floats(0.001, 0.5), seed=st.integers(0, 50))
def test_recordings_of_one_arm_agree(count: int, noise: float, seed: int) -> None:
    assert judged(recordings([0.0] * count, seed, noise)) is None


@pytest.mark.parametrize('seed', range(3))
def test_recordings_of_one_arm_agree_that_are_too_short_to_tell(seed: int) -> None:
    data = [each.select(np.arange(20)) for each in recordings([0.0] * 3, seed, 0.1)]
    assert judged(data) is None


def test_a_load_that_is_taken_up_midway_is_found() -> None:
    before, after = recordings([0.0] * 3, 7), recordings([2.0] * 3, 7)
    late = np.arange(before[1].n_samples) >= before[1].n_samples // 2
    tau = np.where(late[:, None], after[1].tau, before[1].tau)
    before[1] = replace(before[1], tau=tau, tau_noiseless=None)
    assert judged(before) == (['r1 (4 to 7.98 s)'], ['r0', 'r1 (0 to 3.98 s)', 'r2'])


def test_a_recording_that_is_left_out_is_told_when_three_are_left() -> None:
    rms = np.array([[1.0, 1.0], [1.1, 1.0], [0.9, 1.0], [9.0, 1.0]])
    for kept in (np.ones(4, dtype=bool), np.arange(4) < 3):
        assert list(contradictions(rms, kept, ('pan', 'lift'))) == [3]
    assert not contradictions(rms[:3], np.ones(3, dtype=bool), ('pan', 'lift'))


@pytest.mark.slow
def test_a_fleet_of_which_half_has_a_load_is_told(tmp_path: Path) -> None:
    data = recordings([6.0, 0.0] * 2, 2)
    sources = [save(each, tmp_path / f'r{k}.npz', '') for k, each in enumerate(data)]
    model = fit_fleet(sources, Config(), PlainEngine()).model
    names = [str(tmp_path / f'r{k}.npz') for k in (0, 2, 1, 3)]
    either = ' and '.join([', '.join(names[:2]), ', '.join(names[2:])])
    other = ' and '.join([', '.join(names[2:]), ', '.join(names[:2])])
    told = [text for text in fit_cautions(model) if 'as if another load' in text]
    assert told[0].split(' contradict')[0] in (either, other)
