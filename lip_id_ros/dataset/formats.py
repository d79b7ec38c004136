"""Data sets in npz files, and what their provenance has beside settings."""

from __future__ import annotations

from collections.abc import Mapping
import os
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros import files
from lip_id_ros.dataset.checks import DERIVED, INDICES, PER_JOINT, PER_SAMPLE
from lip_id_ros.errors import DataError

DATASET_SUFFIX = '.npz'
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
    'low_passed_sign': '',
    'kinetic': 'J',
    'potential': 'J',
}

_NEEDED = ('q', 'dq', 'ddq', 'tau')
_KEPT = tuple(name for name in (*PER_SAMPLE, *PER_JOINT, *INDICES) if name not in DERIVED)
_KNOWN = (*_KEPT, 'joint_names', 'joint_types')

Arrays = Mapping[str, NDArray[Any]]
PathLike = str | os.PathLike[str]

COPIES = 'copies'
"""Source, samples and repeated samples where an earlier source has them too."""

SELECTED = 'elected'
"""Of a source: how its preprocessing was selected."""

FINDINGS = 'findings'
"""Of a source: errors and warnings of `lip_id_ros.health`, as JSON."""

N_NOTES = 'notes_of_health'
"""Of a source: how many notes `lip_id_ros.health` has beside them."""

MOST_JOINTS = 32
"""Of an arm whose names nobody gave: more are samples."""


def write_npz(
    path: PathLike,
    arrays: Mapping[str, Any],
    gravity_compensated: bool,
    provenance: Mapping[str, Any],
) -> None:
    """Write the arrays of a data set and the header."""
    header = {
        'format': FORMAT,
        'version': VERSION,
        'units': UNITS,
        'gravity_compensated': gravity_compensated,
        'provenance': dict(provenance),
    }
    named = {name: np.asarray(array) for name, array in arrays.items()}
    files.write_npz(path, named, header)


def read_npz(path: PathLike) -> dict[str, Any]:
    """Read the fields of a data set, defaults for what a bare file lacks; see `Dataset.load`."""
    try:
        arrays, header = files.read_npz(path)
    except ValueError as error:
        raise DataError(
            f'{os.fspath(path)} is not a data set ({error}); write one with `lip_id dataset`, or '
            'with numpy.savez from arrays q, dq, ddq and tau.'
        ) from error
    _check_format(path, header)
    _check_complete(path, arrays)
    given: dict[str, Any] = {name: _plain(name, arrays[name]) for name in _KNOWN if name in arrays}
    if 'joint_names' not in given:
        _refuse_rows_of_joints(path, given['q'])
    filled = defaults(given['q'], _step(path, arrays))
    filled['gravity_compensated'] = False
    if 'gravity_compensated' in header:
        given['gravity_compensated'] = bool(header['gravity_compensated'])
    filled = {name: value for name, value in filled.items() if name not in given}
    return {**given, **filled, 'provenance': _provenance(path, header, list(filled))}


def as_columns(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array of shape (N, n); one of shape (N,) is that of one joint."""
    return array[:, np.newaxis] if array.ndim == 1 else array


def defaults(q: NDArray[Any], dt: float = DEFAULT_DT) -> dict[str, Any]:
    """Return what a data set has where nothing but arrays of shape (N, n) are given."""
    n_samples, n_joints = q.shape if q.ndim == 2 else (len(np.atleast_1d(q)), 0)
    return {
        't': dt * np.arange(n_samples),
        'joint_names': tuple(f'joint_{number + 1}' for number in range(n_joints)),
        'joint_types': ('revolute',) * n_joints,
        'segment': np.zeros(n_samples, np.int64),
    }


def _check_format(path: PathLike, header: Mapping[str, Any]) -> None:
    kind = header.get('format', header.get('schema', FORMAT))  # models have a schema
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


def _check_complete(path: PathLike, arrays: Arrays) -> None:
    missing = [name for name in _NEEDED if name not in arrays]
    if missing:
        raise DataError(
            f'{os.fspath(path)} must hold arrays q, dq, ddq and tau, but {", ".join(missing)} '
            f'is missing beside {", ".join(sorted(arrays)) or "nothing"}; save them too.'
        )


def _refuse_rows_of_joints(path: PathLike, q: NDArray[Any]) -> None:
    if q.ndim == 2 and q.shape[1] > max(MOST_JOINTS, q.shape[0]):
        raise DataError(
            f'q in {os.fspath(path)} must have shape (samples, joints), but has {q.shape}, more '
            'joints than samples; transpose the arrays, or save joint_names too.'
        )


def _plain(name: str, array: NDArray[Any]) -> NDArray[Any]:
    if name in ('joint_names', 'joint_types'):
        return array.astype(str).ravel()
    return as_columns(array) if name in PER_JOINT else array


def _step(path: PathLike, arrays: Arrays) -> float:
    dt = arrays.get('dt', np.array(DEFAULT_DT))
    if dt.size != 1 or dt.dtype.kind not in 'fiu' or not 0 < float(dt.item()) < np.inf:
        raise DataError(
            f'dt in {os.fspath(path)} must be one positive number of seconds, not {dt.tolist()!r}.'
        )
    return float(dt.item())


def _provenance(path: PathLike, header: Mapping[str, Any], defaults: list[str]) -> dict[str, Any]:
    provenance = header.get('provenance')
    if provenance is not None and not isinstance(provenance, dict):
        raise DataError(
            f'the provenance in {os.fspath(path)} must be a mapping, not '
            f'{str(provenance)[:40]!r}; write the data set again.'
        )
    if provenance is not None:
        return provenance
    return {'sources': [{'source': os.fspath(path), 'defaults': defaults}]}


def is_data_set(path: PathLike) -> bool:
    """Whether a file is a data set as `Dataset.save` writes it."""
    try:
        return bool(files.read_header(path).get('format') == FORMAT)
    except ValueError:
        return False


def cutoffs_hz(provenance: Mapping[str, Any]) -> set[float | None]:
    """Return the cut-offs of all sources [Hz], 0 without a low-pass; None where not known."""
    cutoffs: set[float | None] = set()
    for source in provenance.get('sources', ()):
        # a fleet lists settings once, simulations and arrays have none
        settings = source.get('preprocessing') if isinstance(source, Mapping) else None
        cutoff = settings.get('cutoff_hz') if isinstance(settings, Mapping) else None
        if isinstance(cutoff, int | float):
            cutoffs.add(float(cutoff) if source.get('filtered', True) else 0.0)
        else:
            cutoffs.add(None)
    return cutoffs or {None}


def sample_interval_s(provenance: Mapping[str, Any]) -> float | None:
    """Return the time between samples in the median of the sources [s], None where not known."""
    intervals = []
    for source in provenance.get('sources', ()):
        known = source if isinstance(source, Mapping) else {}
        rate, kept_every = known.get('rate_hz'), known.get('kept_every')
        if isinstance(rate, int | float) and isinstance(kept_every, int) and rate > 0.0:
            intervals.append(kept_every / rate)
    return median(intervals) if intervals else None
