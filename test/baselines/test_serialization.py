"""A model of the literature predicts the same after it was written and read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from baselines.panda_runs import runs
from evaluation.models import small_model
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.baselines import Baseline, learn, LITERATURE, needs_urdf
from lip_id_ros.baselines.registry import flattened, load, rebuilt, save
from lip_id_ros.checked_file import COMPARED, write_checked
from lip_id_ros.errors import ConfigError, ModelError
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation.arm import panda_urdf

pytest.importorskip('torch')
pytest.importorskip('pinocchio')
SETTINGS = FitSettings(subset=20, max_samples=30)


def fitted(name: str) -> Baseline:
    train, _ = runs(2, 40)
    return learn(name, train, SETTINGS, panda_urdf() if needs_urdf(name) else None, silent)


@pytest.mark.parametrize('name', LITERATURE)
def test_a_model_is_read_as_it_was_written(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lip_id_ros.baselines import delan

    monkeypatch.setattr(delan.Delan.__init__, '__defaults__', (20,))
    before = fitted(name)
    save(tmp_path / 'model.npz', before)
    after = load(tmp_path / 'model.npz')

    _, unseen = runs(2, 40)
    for expected, found in zip(
        vars(before.predict(unseen.q, unseen.dq, unseen.ddq)).items(),
        vars(after.predict(unseen.q, unseen.dq, unseen.ddq)).items(),
        strict=True,
    ):
        assert expected[0] == found[0]
        assert (expected[1] is None) == (found[1] is None)
        if expected[1] is not None:
            np.testing.assert_array_equal(found[1], expected[1])
    for part in ('record', 'joint_names', 'joint_types', 'size', 'has_potential'):
        assert getattr(after, part) == getattr(before, part)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    save(tmp_path / 'model.npz', fitted('rigid_body'))
    return tmp_path / 'model.npz'


def test_a_damaged_file_or_another_kind_is_refused(saved: Path, tmp_path: Path) -> None:
    arrays, header = read_npz(saved)
    write_npz(saved, {**arrays, 'array_0': arrays['array_0'] + 1}, header)
    with pytest.raises(ModelError, match='is damaged: its contents do not match their hash'):
        load(saved)
    small_model().save(tmp_path / 'ours.npz')
    with pytest.raises(ModelError, match=r"its schema is 'lip_id_ros/model', expected"):
        load(tmp_path / 'ours.npz')


def test_serving_refuses_it_and_names_its_kind(saved: Path) -> None:
    with pytest.raises(
        ModelError, match="is a model of the kind 'rigid_body', for lip_id inspect"
    ):
        InverseDynamicsModel.load(saved)


@pytest.mark.parametrize(
    ('change', 'sentence'),
    [
        ({'method': 'os.system'}, "the unknown method 'os.system'"),
        ({'method_version': 99}, "version 99 of the method 'rigid_body'"),
        ({'method': ['a']}, 'contradicts itself'),
        ({'method': 'se'}, 'contradicts itself'),
        ({'state': {'code': 1}}, "the unknown kind 'code'"),
        ({'state': {'array': 'none'}}, 'contradicts itself'),
        ({'state': {'items': {}}}, 'contradicts itself'),
        ({'state': 5}, 'contradicts itself'),
        ({'provenance': 5}, 'contradicts itself'),
        ({'n_samples': 'many'}, 'contradicts itself'),
        ({'joint_names': 1}, 'contradicts itself'),
    ],
)
def test_a_tampered_file_with_a_new_hash_is_refused(
    saved: Path, change: dict[str, Any], sentence: str
) -> None:
    arrays, header = read_npz(saved)
    rest = {name: each for name, each in header.items() if name != 'sha256'}
    write_checked(saved, COMPARED, header['version'], arrays, {**rest, **change})
    with pytest.raises(ModelError, match=sentence):
        load(saved)


def test_a_path_has_no_place_in_a_state() -> None:
    with pytest.raises(TypeError, match=r'numbers, texts and arrays was expected, not .*Path'):
        flattened([Path('a')], {})


def test_a_model_of_this_package_is_not_one_of_the_literature() -> None:
    with pytest.raises(ConfigError, match="'lip' is a model of this package"):
        learn('lip', runs(2, 40)[0], FitSettings(iterations=1), None, silent)


NUMBERS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()


@pytest.mark.slow
@given(
    st.recursive(
        NUMBERS, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=10
    )
)
def test_any_state_is_rebuilt(state: Any) -> None:
    arrays: dict[str, Any] = {}
    assert rebuilt(flattened({'a': state, 'b': np.eye(2)}, arrays), arrays)['a'] == state
    assert list(arrays) == ['array_0']
