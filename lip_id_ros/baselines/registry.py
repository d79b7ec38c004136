"""
Methods by name, and the files of their models.

The packages of a method are imported only when it is used. A file has the name and version of the
method and the state of the model, without pickle: a tree of mappings, lists, numbers and texts,
whose arrays are stored beside it.

"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import import_module
import os
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.baselines.interface import Baseline, FitRecord, Method, Urdf
from lip_id_ros.checked_file import (
    Arrays,
    COMPARED,
    contradiction,
    read_checked,
    write_checked,
)
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError, DataError, LipIdError, ModelError
from lip_id_ros.identification import fit
from lip_id_ros.model import TorqueModel
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings


@dataclass(frozen=True)
class OurMethod:
    """The Gaussian processes and rigid links of this package; `kernel` as in `fit.kernel`."""

    kernel: str

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> TorqueModel:
        """Fit as `lip_id fit --kernel` does."""
        return fit(dataset, replace(settings, kernel=self.kernel), progress)


@dataclass(frozen=True)
class LiteratureMethod:
    """
    A method of the literature.

    Attributes
    ----------
    meaning : str
        For the readers of a comparison.
    module : str
        In `lip_id_ros.baselines`; has `METHODS` (see `interface`) and `read(joints, state)`.
    version : int
        Of the state that its models write.
    needs_urdf : bool
        Whether it needs the kinematics of the robot.

    """

    meaning: str
    module: str
    version: int = 1
    needs_urdf: bool = False


LITERATURE = {
    'se': LiteratureMethod('a Gaussian process per joint, squared exponential', 'single_output'),
    'gip': LiteratureMethod(
        'a Gaussian process per joint, geometrically inspired polynomial kernel', 'single_output'
    ),
    'lse': LiteratureMethod('a Gaussian process on the Lagrangian, squared exponential', 'lse'),
    'delan': LiteratureMethod('a deep Lagrangian network', 'delan'),
    'rigid_body': LiteratureMethod(
        'least squares on rigid-body dynamics with smooth friction, kinematics known from a URDF',
        'rigid_body',
        version=2,
        needs_urdf=True,
    ),
    'rigid_body_friction': LiteratureMethod(
        'the same with the friction terms of the default fit, elected joint by joint',
        'rigid_body_friction',
        needs_urdf=True,
    ),
    'semiparametric': LiteratureMethod(
        'a Gaussian process per joint, rigid-body features and squared exponential',
        'single_output',
        version=2,
        needs_urdf=True,
    ),
}
OURS = {
    'lip': "Gaussian processes on the energies, the paper's polynomial kernel",
    'recursive': 'Gaussian processes on the energies, a kernel composed from base to tip',
    'articulated': 'rigid links whose joints are located by the fit, and Gaussian processes '
    'for the residual where they help; the default of this package',
}
MODELS = (*LITERATURE, *OURS)
"""Names of all methods."""
MEANINGS = {**{name: entry.meaning for name, entry in LITERATURE.items()}, **OURS}
"""A description of each method."""


def needs_urdf(name: str) -> bool:
    """Whether a method needs the kinematics of the robot."""
    return name in LITERATURE and LITERATURE[name].needs_urdf


def method(name: str, urdf: Urdf | None = None) -> Method:
    """
    Return one of `MODELS` by its name; some need the URDF of the robot.

    Raises
    ------
    ConfigError
        If there is no such method, or it needs a URDF and none is given.
    DataError
        If the URDF cannot be read as one.
    LipIdError
        If a package is missing.
    OSError
        If the URDF cannot be opened.

    """
    if name in OURS:
        return OurMethod(name)
    if name not in LITERATURE:
        raise ConfigError(f'{name!r} is not a model; there are {", ".join(MODELS)}.')
    if needs_urdf(name) and urdf is None:
        raise ConfigError(
            f'the model {name!r} needs the kinematics of the robot; name its URDF file.'
        )
    made: Method = _module(name).METHODS[name](urdf or '')
    return made


def learn(
    name: str, dataset: Dataset, settings: FitSettings, urdf: Urdf | None, progress: Progress
) -> Baseline:
    """
    Fit a method of the literature, a key of `LITERATURE`; some need the URDF of the robot.

    Raises
    ------
    LipIdError
        If there is no such method, a package is missing, or the fit fails.
    OSError
        If the URDF cannot be opened.

    """
    started = time.perf_counter()
    model = method(name, urdf).fit(dataset, settings, progress)
    if not isinstance(model, Baseline):
        raise ConfigError(
            f'{name!r} is a model of this package; there are {", ".join(LITERATURE)} of the '
            'literature.'
        )
    seconds = time.perf_counter() - started
    model.record = FitRecord(name, dataset.n_samples, seconds, dataset.provenance)
    return model


def _module(name: str) -> Any:
    try:
        return import_module(f'lip_id_ros.baselines.{LITERATURE[name].module}')
    except ImportError as error:
        raise LipIdError(
            f'the model {name!r} needs a package that is missing ({error}); '
            "install it with `pip install 'lip_id_ros[torch]'`."
        ) from error


VERSION = 3
ARRAY = 'array'
CONTRADICTIONS = (
    *(AttributeError, KeyError, IndexError, RuntimeError, TypeError, ValueError),
    *(DataError, ModelError),
)


def save(path: str | os.PathLike[str], model: Baseline) -> None:
    """Write a model into one npz file, whole or not at all; OSError if that fails."""
    arrays: Arrays = {}
    record = model.record
    header = {
        'method': record.method,
        'method_version': LITERATURE[record.method].version,
        'joint_names': list(model.joint_names),
        'joint_types': list(model.joint_types),
        'n_samples': record.n_samples,
        'fit_seconds': record.seconds,
        'provenance': dict(record.provenance),
        'state': flattened(model.state(), arrays),
    }
    write_checked(path, COMPARED, VERSION, arrays, header)


def load(path: str | os.PathLike[str]) -> Baseline:
    """
    Read a model.

    Raises
    ------
    OSError
        If the file does not exist or cannot be opened.
    ModelError
        If it is damaged, is not such a model, or comes from another version.
    LipIdError
        If a package that the method needs is missing.

    """
    arrays, header = read_checked(path, COMPARED, VERSION)
    try:
        name = _known_method(header['method'], header['method_version'])
        joints = tuple(header['joint_names']), tuple(header['joint_types'])
        model: Baseline = _module(name).read(joints, rebuilt(header['state'], arrays))
        model.record = FitRecord(
            name,
            int(header['n_samples']),
            float(header['fit_seconds']),
            dict(header['provenance']),
        )
    except CONTRADICTIONS as error:
        raise contradiction(path, error) from error
    return model


def flattened(value: Any, arrays: Arrays) -> Any:
    """Return a state as JSON; its arrays are added to `arrays` and referred to by name."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.ndarray):
        name = f'{ARRAY}_{len(arrays)}'
        arrays[name] = value
        return {ARRAY: name}
    if isinstance(value, (list, tuple)):
        return [flattened(part, arrays) for part in value]
    if isinstance(value, Mapping):
        return {'items': {name: flattened(part, arrays) for name, part in value.items()}}
    raise TypeError(f'a state of numbers, texts and arrays was expected, not {type(value)}')


def rebuilt(content: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    """
    Return the state that was flattened.

    Raises
    ------
    KeyError, TypeError, ValueError
        If the content is not a flattened state, or an array is missing.

    """
    if isinstance(content, list):
        return [rebuilt(part, arrays) for part in content]
    if not isinstance(content, dict):
        return content
    ((kind, value),) = content.items()
    if kind == ARRAY:
        return arrays[value]
    if kind == 'items':
        return {name: rebuilt(part, arrays) for name, part in value.items()}
    raise ValueError(f'a part of the unknown kind {kind!r}')


def _known_method(name: str, version: int) -> str:
    if name not in LITERATURE:
        raise ModelError(f'the unknown method {name!r}')
    if version != LITERATURE[name].version:
        raise ModelError(f'version {version!r} of the method {name!r}, which is not known here')
    return name
