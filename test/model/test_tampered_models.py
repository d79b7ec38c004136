"""Models whose contents were changed and whose hash was computed anew are refused or harmless."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from model.models import random_model
import numpy as np
import pytest

from lip_id_ros.errors import ModelError
from lip_id_ros.files import read_npz
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.checked_file import MODEL, write_checked
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED


@pytest.fixture(params=[ARTICULATED, 'recursive'])
def path(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    random_model(request.param).save(tmp_path / 'model.npz')
    return tmp_path / 'model.npz'


def tamper(path: Path, arrays: dict[str, Any], header: dict[str, Any]) -> None:
    rest = {name: each for name, each in header.items() if name != 'sha256'}
    write_checked(path, MODEL, header['version'], arrays, rest)


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_no_number_that_is_not_finite_is_read(path: Path, value: float) -> None:
    arrays, header = read_npz(path)
    names = [name for name, values in arrays.items() if values.dtype.kind == 'f' and values.size]
    assert len(names) > 5
    for name in names:
        changed = arrays[name].copy()
        changed.flat[0] = value
        tamper(path, {**arrays, name: changed}, header)
        with pytest.raises(ModelError, match=f"'{name}', which is not finite"):
            InverseDynamicsModel.load(path)


@pytest.mark.parametrize('value', [5, 'text', None, [1], {}, [], [[]], {'a': {'b': 1}}])
def test_any_value_in_the_header_is_read_or_refused_with_a_sentence(
    path: Path, value: object
) -> None:
    arrays, header = read_npz(path)
    for name in header:
        if name != 'sha256':
            tamper(path, arrays, {**header, name: value})
            try:
                model = InverseDynamicsModel.load(path)
            except ModelError:
                continue
            zero = np.zeros((1, model.n_joints))
            assert np.isfinite(model.predict(zero, zero, zero).tau).all(), name


def test_a_missing_or_misshapen_array_is_refused(path: Path) -> None:
    arrays, header = read_npz(path)
    for name, values in arrays.items():
        without = {other: each for other, each in arrays.items() if other != name}
        for changed in (without, {**arrays, name: values[None]}, {**arrays, name: values[:0]}):
            tamper(path, changed, header)
            try:
                model = InverseDynamicsModel.load(path)
            except ModelError:
                continue
            zero = np.zeros((1, model.n_joints))
            assert model.predict(zero, zero, zero).tau.shape == zero.shape, name
