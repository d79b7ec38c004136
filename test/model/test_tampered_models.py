"""Models whose contents were changed and whose hash was computed anew are refused or harmless."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from model.models import random_model
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.checked_file import write_checked
from lip_id_ros.errors import ModelError
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED


@pytest.fixture(params=[ARTICULATED, 'recursive'])
def path(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    random_model(request.param).save(tmp_path / 'model.npz')
    return tmp_path / 'model.npz'


def tamper(path: Path, arrays: dict[str, Any], header: dict[str, Any]) -> None:
    rest = {name: each for name, each in header.items() if name != 'sha256'}
    write_checked(path, header['version'], arrays, rest)


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
def test_any_value_in_the_header_is_read_or_refused(path: Path, value: object) -> None:
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


IMPOSSIBLE: dict[str, tuple[Callable[[Array], Array], str]] = {
    'arm_rotations': (lambda x: 1.01 * x, 'which are not all rotations'),
    'arm_links': (lambda x: -x, 'of which some cannot exist'),
    'arm_translations': (lambda x: 1e10 + x, "with 1e\\+10 in it"),
    'arm_noise': (lambda x: -x, 'arm_noise, with -'),
    'arm_covariance_root': (lambda x: x.astype(np.complex64), 'which holds complex64'),
    'arm_coordinates': (lambda x: np.zeros_like(x), 'arm_coordinates, which come twice'),
    'training_low': (lambda x: x + 1e6, 'training_low, which lies above training_high'),
    'training_high': (lambda x: x.astype('>f8'), 'training_high, which holds >f8'),
    'remainder_lengths': (lambda x: -x, 'remainder_lengths, of which some'),
    'arm_couplings': (lambda x: 0.3 * x, 'arm_couplings, with joints 0 and 0'),
    'remainder_variance': (lambda x: -x, 'remainder_variance, with -'),
    'remainder_scale': (lambda x: x.astype('U8'), 'remainder_scale, which holds <U8'),
    'known_scale': (lambda x: 0.0 * x, 'known_scale, with 0 in it'),
    'known_states': (lambda x: x[:0], 'known_states, of which there are none'),
    'known_left_out': (lambda x: -x, 'known_left_out, with -'),
    'noise_variance': (lambda x: -x, 'noise_variance, with -'),
    'basis_half_range': (lambda x: 0 * x, 'basis_half_range, with 0 in it'),
    'weights_kinetic_scales': (lambda x: -x, 'weights_kinetic_scales, with -'),
}  # fmt: skip


def test_numbers_of_no_arm_are_refused(path: Path) -> None:
    arrays, header = read_npz(path)
    known = [name for name in IMPOSSIBLE if name in arrays]
    assert len(known) > 4
    for name in known:
        change, sentence = IMPOSSIBLE[name]
        tamper(path, {**arrays, name: change(arrays[name])}, header)
        with pytest.raises(ModelError, match=sentence):
            InverseDynamicsModel.load(path)


def test_numbers_of_another_type_have_another_hash(path: Path) -> None:
    """The bytes and shapes are the same."""
    arrays, header = read_npz(path)
    for name, values in arrays.items():
        if values.dtype == np.float64 and values.size:
            write_npz(path, {**arrays, name: values.view(np.int64)}, header)
            with pytest.raises(ModelError, match='is damaged: its contents do not match'):
                InverseDynamicsModel.load(path)


def test_columns_without_rows_take_no_memory(path: Path) -> None:
    """They have no bytes in the file; 37 GB were asked for."""
    arrays, header = read_npz(path)
    if 'arm_covariance_root' in arrays:
        empty = {'arm_coordinates': np.zeros(0, np.uint16)}
        empty |= {'arm_covariance_root': np.zeros((0, 10**8), np.float32)}
        tamper(path, {**arrays, **empty}, header)
        with pytest.raises(ModelError, match='arm_covariance_root, with 100000000 columns for'):
            InverseDynamicsModel.load(path)
