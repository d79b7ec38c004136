"""The file in which `adapt` keeps what it has learned, from one start to the next."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path

import numpy as np

from lip_id_ros.adaptation.adaptation import Adaptation
from lip_id_ros.errors import ConfigError, SourceError
from lip_id_ros.files import read_npz, state_folder, write_npz

SCHEMA, VERSION = 'lip_id_ros/adaptation', 2

NOT_KEPT = 'none'
"""The word that stands for no file."""


def path_of(given: str, node: str) -> Path | None:
    """Return the file of a node by its full name, None where nothing is kept."""
    if given == NOT_KEPT:
        return None
    return Path(given) if given else state_folder(node) / 'adaptation.npz'


def save(path: Path, node: str, adaptation: Adaptation, now: float) -> None:
    """
    Write what was learned, whole or not at all; OSError if that fails.

    `now`: time by the clock of the computer [s].

    """
    header = {
        'schema': SCHEMA,
        'version': VERSION,
        'node': node,
        'model': adaptation.commissioned.fingerprint,
        'saved_at': now,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_npz(path, adaptation.state(), header)


def resume(path: Path, node: str, adaptation: Adaptation, now: float) -> None:
    """
    Go on from a file, if there is one.

    A file that cannot be used is put aside: SourceError says why, and where it lies. ConfigError
    if it is of another node, which goes on with it.

    """
    if not path.exists():
        return
    try:
        arrays, header = read_npz(path)
        _check(path, header, node, adaptation.commissioned.fingerprint)
        state = {name: np.asarray(each, dtype=np.float64) for name, each in arrays.items()}
        adaptation.resume(state, now - float(header['saved_at']))
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        kept = path.with_name(f'{path.name}.old')
        os.replace(path, kept)
        raise SourceError(
            f'{path} must be what adapt has saved of this model, but has {error}; it is kept as '
            f'{kept}, and what was learned begins anew.'
        ) from error


def _check(path: Path, header: Mapping[str, object], node: str, model: str) -> None:
    if header.get('schema') != SCHEMA or header.get('version') != VERSION:
        raise ValueError('another format')
    if header['node'] != node:
        raise ConfigError(
            f'state_path must be a file of {node} alone, but {path} is of {header["node"]}, whose '
            'payloads are not carried here; nothing is kept until another one is given.'
        )
    if header['model'] != model:
        raise ValueError('the state of another model')
