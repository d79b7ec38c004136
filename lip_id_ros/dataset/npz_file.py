"""Data sets as npz files, and the defaults of bare ones."""

from __future__ import annotations

from collections.abc import Mapping
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.dataset.checks import PER_JOINT, PER_SAMPLE
from lip_id_ros.errors import DataError
from lip_id_ros.files import read_npz, write_npz

FORMAT = 'lip_id_ros data set'
VERSION = 1
DEFAULT_DT = 1.0
UNITS = {
    't': 's',
    'q': 'rad or m',
    'dq': 'rad/s or m/s',
    'ddq': 'rad/s^2 or m/s^2',
    'tau': 'N m or N',
    'tau_noiseless': 'N m or N',
    'kinetic': 'J',
    'potential': 'J',
}

_NEEDED = ('q', 'dq', 'ddq', 'tau')
_KNOWN = (*PER_SAMPLE, *PER_JOINT, 'segment', 'joint_names', 'joint_types')

Arrays = Mapping[str, NDArray[Any]]


def write(
    path: str | os.PathLike[str],
    values: Mapping[str, Any],
    gravity_compensated: bool,
    provenance: Mapping[str, Any],
) -> None:
    """Write the arrays of a data set that are not None, and the header."""
    arrays = {name: np.asarray(value) for name, value in values.items() if value is not None}
    header = {
        'format': FORMAT,
        'version': VERSION,
        'units': UNITS,
        'gravity_compensated': gravity_compensated,
        'provenance': dict(provenance),
    }
    write_npz(path, arrays, header)


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """
    Read what a data set is made of; what a bare file leaves out gets its default.

    Raises
    ------
    OSError
        If the file cannot be opened.
    DataError
        If it is not a data set.

    """
    try:
        arrays, header = read_npz(path)
    except ValueError as error:
        raise DataError(
            f'{os.fspath(path)} is not a data set ({error}); write one with `lip_id dataset`, or '
            'with numpy.savez from arrays q, dq, ddq and tau.'
        ) from error
    _check_format(path, header)
    _check_complete(path, arrays)
    given = {name: _plain(name, arrays[name]) for name in _KNOWN if name in arrays}
    defaults = _defaults(given['q'], _step(path, arrays))
    missing = {name: value for name, value in defaults.items() if name not in given}
    return {
        **given,
        **missing,
        'gravity_compensated': bool(header.get('gravity_compensated', False)),
        'provenance': _provenance(path, header, list(missing)),
    }


def _check_format(path: str | os.PathLike[str], header: Mapping[str, Any]) -> None:
    kind = header.get('format', FORMAT)
    if kind != FORMAT:
        raise DataError(
            f'{os.fspath(path)} must be a data set, but it is a {kind}; give a recording or a '
            'file that `lip_id dataset` wrote.'
        )
    version = header.get('version', VERSION)
    if version != VERSION:
        raise DataError(
            f'{os.fspath(path)} must be a data set of version {VERSION}, not {version}; '
            'write it again with this version of lip_id.'
        )


def _check_complete(path: str | os.PathLike[str], arrays: Arrays) -> None:
    missing = [name for name in _NEEDED if name not in arrays]
    if missing:
        raise DataError(
            f'{os.fspath(path)} must hold arrays q, dq, ddq and tau, but {", ".join(missing)} '
            f'is missing beside {", ".join(sorted(arrays)) or "nothing"}; save them too.'
        )


def _plain(name: str, array: NDArray[Any]) -> NDArray[Any]:
    if name in ('joint_names', 'joint_types'):
        return array.astype(str).ravel()
    return array[:, np.newaxis] if name in PER_JOINT and array.ndim == 1 else array


def _step(path: str | os.PathLike[str], arrays: Arrays) -> float:
    dt = arrays.get('dt', np.array(DEFAULT_DT))
    if dt.size != 1 or dt.dtype.kind not in 'fiu' or not 0 < float(dt.item()) < np.inf:
        raise DataError(
            f'dt in {os.fspath(path)} must be one positive number of seconds, not {dt.tolist()!r}.'
        )
    return float(dt.item())


def _defaults(q: NDArray[Any], dt: float) -> dict[str, Any]:
    n_samples, n_joints = q.shape if q.ndim == 2 else (len(np.atleast_1d(q)), 0)
    return {
        't': dt * np.arange(n_samples),
        'joint_names': tuple(f'joint_{number + 1}' for number in range(n_joints)),
        'joint_types': ('revolute',) * n_joints,
        'segment': np.zeros(n_samples, np.int64),
    }


def _provenance(
    path: str | os.PathLike[str], header: Mapping[str, Any], defaults: list[str]
) -> dict[str, Any]:
    if 'provenance' in header:
        return dict(header['provenance'])
    return {'sources': [{'source': os.fspath(path), 'defaults': defaults}]}
