"""A model of the literature is after its file what it was before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from baselines.panda_runs import runs
from evaluation.models import small_model
import numpy as np
import pytest

from lip_id_ros.baselines import MODELS
from lip_id_ros.baselines.learned import learn, Learned
from lip_id_ros.baselines.registry import needs_urdf, OURS
from lip_id_ros.baselines.taken_apart import put_together, take_apart
from lip_id_ros.errors import ModelError
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.model import TrainedModel
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation.panda import panda_urdf

pytest.importorskip('torch')
pytest.importorskip('pinocchio')
SETTINGS = FitSettings(subset=20, max_samples=30)
OTHERS = [name for name in MODELS if name not in OURS]


def fitted(name: str) -> Learned:
    train, _ = runs(2, 40)
    return learn(name, train, SETTINGS, panda_urdf() if needs_urdf(name) else None, silent)


@pytest.mark.parametrize('name', OTHERS)
def test_a_model_is_read_as_it_was_written(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lip_id_ros.baselines import delan

    monkeypatch.setattr(delan.Delan.__init__, '__defaults__', (20,))
    before = fitted(name)
    before.save(tmp_path / 'model.npz')
    after = Learned.load(tmp_path / 'model.npz')

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
    assert after.estimator.size == before.estimator.size
    for part in ('method', 'joint_names', 'joint_types', 'n_samples', 'fit_seconds', 'provenance'):
        assert getattr(after, part) == getattr(before, part)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    fitted('rigid_body').save(tmp_path / 'model.npz')
    return tmp_path / 'model.npz'


def test_what_the_file_does_not_hold_whole_is_refused(saved: Path, tmp_path: Path) -> None:
    arrays, header = read_npz(saved)
    arrays['array_0'] = arrays['array_0'] + 1
    write_npz(saved, arrays, header)
    with pytest.raises(ModelError, match='is damaged: its contents do not match their hash'):
        Learned.load(saved)
    small_model().save(tmp_path / 'ours.npz')
    with pytest.raises(ModelError, match=r"its schema is 'lip_id_ros/model', expected"):
        Learned.load(tmp_path / 'ours.npz')


def test_serving_refuses_it_and_says_what_it_is(saved: Path) -> None:
    with pytest.raises(
        ModelError, match="is a model of the kind 'rigid_body', for lip_id inspect"
    ):
        TrainedModel.load(saved)


@pytest.mark.parametrize(
    ('entry', 'sentence'),
    [
        ({'class': 'os:PathLike', 'fields': {'dict': {}}}, 'os:PathLike, which is not of this'),
        ({'class': 'subprocess:Popen', 'fields': {'dict': {}}}, 'which is not of this package'),
        ({'class': 'lip_id_ros.baselines.lse:np', 'fields': {'dict': {}}}, 'is not there'),
        ({'class': 'lip_id_ros.baselines.lse:Path', 'fields': {'dict': {}}}, 'is not there'),
        ({'class': 'lip_id_ros.baselines.lse:Lse', 'fields': {'code': 1}}, "kind 'code'"),
    ],
)
def test_a_file_cannot_name_other_code(entry: dict[str, Any], sentence: str) -> None:
    with pytest.raises((TypeError, ValueError), match=sentence):
        put_together({}, [entry])


def test_what_cannot_be_kept_is_said_when_it_is_written() -> None:
    with pytest.raises(TypeError, match='Path, which is not of this package'):
        take_apart([Path('a')])
