"""One model, one file: what is loaded answers as what was saved, and nothing else is loaded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import os
from pathlib import Path
import re
from typing import Any

from gp.cases import P, R
from gp.processes import process_of
from hypothesis import given
from hypothesis import strategies as st
from kernels.cases import random_states
from model.models import (
    KERNELS,
    random_model,
    random_model_without_gravity,
    random_model_without_potential,
)
import numpy as np
from numpy.typing import NDArray
import pytest

from lip_id_ros.checked_file import write_checked
from lip_id_ros.errors import ModelError
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED

Arrays = dict[str, NDArray[Any]]
Header = dict[str, Any]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / 'model.npz'


@pytest.fixture
def saved(path: Path) -> Path:
    random_model('recursive').save(path)
    return path


def assert_same_answers(first: InverseDynamicsModel, second: InverseDynamicsModel) -> None:
    x = random_states(5, first.n_joints, np.random.default_rng(3))
    for got, expected in zip(answers(second, x), answers(first, x), strict=True):
        np.testing.assert_array_equal(got, expected)


def answers(model: InverseDynamicsModel, x: Any) -> list[Any]:
    predictor = model
    found = [*vars(predictor.predict(*x)).values()]
    found += vars(predictor.standard_deviation(*x)).values()
    return [*found, predictor.inertia_matrix(x[0])]


@pytest.mark.parametrize('terms', [False, True])
@pytest.mark.parametrize('member', KERNELS)
def test_round_trip(member: str, terms: bool, path: Path) -> None:
    model = replace(
        random_model(member, (R, P, R), friction=terms, residual_gp=terms),
        provenance={'sources': ['a.mcap'], 'n_samples_available': 9},
    )
    model.save(path)
    loaded = InverseDynamicsModel.load(path)
    assert_same_answers(model, loaded)
    for name in ('joint_names', 'joint_types', 'kernel', 'n_samples', 'summary', 'provenance'):
        assert getattr(loaded, name) == getattr(model, name)
    np.testing.assert_array_equal(loaded.noise_std, model.noise_std)
    assert os.listdir(path.parent) == [path.name]


def test_novelty_is_in_the_file(path: Path) -> None:
    model = random_model(ARTICULATED)
    model.save(path)
    x = random_states(5, model.n_joints, np.random.default_rng(3))
    novelty = InverseDynamicsModel.load(path).novelty(*x)
    assert novelty.min() > 0.0
    np.testing.assert_array_equal(novelty, model.novelty(*x))


def test_a_file_without_training_states_is_read(path: Path) -> None:
    replace(random_model(ARTICULATED), known_states=None).save(path)
    loaded = InverseDynamicsModel.load(path)
    assert np.isnan(loaded.novelty(*np.zeros((3, 2, loaded.n_joints)))).all()


def test_round_trip_without_potential(path: Path) -> None:
    model = random_model_without_potential('lip')
    model.save(path)
    assert not InverseDynamicsModel.load(path).has_potential
    assert_same_answers(model, InverseDynamicsModel.load(path))


def test_round_trip_of_links_without_gravity(path: Path) -> None:
    model = random_model_without_gravity()
    model.save(path)
    assert InverseDynamicsModel.load(path).kernel == ARTICULATED
    assert not InverseDynamicsModel.load(path).has_potential
    assert_same_answers(model, InverseDynamicsModel.load(path))


def test_an_arm_of_format_7_has_no_coupled_positions(path: Path) -> None:
    model = random_model(ARTICULATED, residual_gp=False)
    assert model.arm is not None
    chain = model.arm.chain._replace(couplings=np.zeros((0, 3)))
    serial = replace(model, arm=replace(model.arm, chain=chain))
    serial.save(path)
    arrays, header = read_npz(path)
    del arrays['arm_couplings'], header['sha256']
    write_checked(path, 7, arrays, header)
    assert_same_answers(serial, InverseDynamicsModel.load(path))


def check_refused(path: Path, sentence: str) -> None:
    """The sentence names the file and ends in what to do."""
    with pytest.raises(ModelError, match=sentence) as caught:
        InverseDynamicsModel.load(path)
    text = str(caught.value)
    assert text.startswith(f'{path} ')
    assert re.search(r'; (fit again|pass the file that)[^;]*\.$', text)


@pytest.mark.parametrize('share', [0.0, 0.3, 0.99])
def test_a_truncated_file(saved: Path, share: float) -> None:
    content = saved.read_bytes()
    saved.write_bytes(content[: int(share * len(content))])
    check_refused(
        saved, r'must be a model that `lip_id fit` wrote, but is none \(not an npz archive'
    )


def test_an_npz_of_something_else(path: Path) -> None:
    np.savez(path, q=np.ones(3))
    check_refused(path, r'is not a model of lip_id_ros \(its schema is None, expected')


def changed(path: Path, change: Callable[[Arrays, Header], None]) -> Path:
    """Write the file again with its arrays or header changed."""
    arrays, header = read_npz(path)
    change(arrays, header)
    write_npz(path, arrays, header)
    return path


def test_a_newer_format(saved: Path) -> None:
    newer = changed(saved, lambda _, header: header.update(version=9))
    check_refused(newer, 'has model format 9, but this program reads format 7 or 8')


def flip(arrays: Arrays, _: Header) -> None:
    arrays['alpha'][0, 0] = -arrays['alpha'][0, 0]


def drop(arrays: Arrays, _: Header) -> None:
    del arrays['alpha']


@pytest.mark.parametrize('change', [flip, drop])
def test_contents_that_are_not_those_that_were_written(
    saved: Path, change: Callable[[Arrays, Header], None]
) -> None:
    check_refused(changed(saved, change), 'is damaged: its contents do not match their hash')


@given(place=st.floats(0.0, 1.0, exclude_max=True), bit=st.integers(0, 7))
def test_no_flipped_bit_changes_an_answer(
    place: float, bit: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Whatever goes wrong on the way, a model is refused or is the one that was saved."""
    path = tmp_path_factory.mktemp('model') / 'model.npz'
    model = random_model('recursive', friction=False)
    model.save(path)
    content = bytearray(path.read_bytes())
    content[int(place * len(content))] ^= 1 << bit
    path.write_bytes(content)
    try:
        loaded = InverseDynamicsModel.load(path)
    except ModelError:
        return
    np.testing.assert_array_equal(process_of(loaded).alpha, process_of(model).alpha)
    assert loaded.summary == model.summary


def other_kernel(_: Arrays, header: Header) -> None:
    header['process']['kernel'] = 'perceptron'


def other_inflation(_: Arrays, header: Header) -> None:
    header['process']['inflation'] = -1.0


def other_joints(_: Arrays, header: Header) -> None:
    header['joint_types'] = [R, R]


@pytest.mark.parametrize(
    ('change', 'what'),
    [
        (drop, "'alpha'"),
        (other_kernel, "'perceptron'"),
        (other_joints, '2 joint types for 3 joints'),
        (other_inflation, 'an inflation of -1.0'),
    ],
)
def test_contents_that_do_not_fit_together(
    saved: Path,
    change: Callable[[Arrays, Header], None],
    what: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The file is changed and has its hash nevertheless."""
    stored = read_npz(saved)[1]['sha256']
    monkeypatch.setattr('lip_id_ros.checked_file._digest', lambda *_: stored)
    sentence = f'says it is a model but lacks or contradicts itself in .*{what}'
    check_refused(changed(saved, change), sentence)
