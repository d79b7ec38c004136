"""Methods by name; the packages of a method are imported only when it is used."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

from benchmarks.baselines.interface import Method, Urdf
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError, LipIdError
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
    A method of the literature: its meaning for readers, and its module in `benchmarks.baselines`.

    The module has `METHODS` (see `interface`); `needs_urdf` says whether it needs the kinematics.

    """

    meaning: str
    module: str
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
        needs_urdf=True,
    ),
    'rigid_body_friction': LiteratureMethod(
        'the same with the friction terms of the default fit, selected joint by joint',
        'rigid_body_friction',
        needs_urdf=True,
    ),
    'semiparametric': LiteratureMethod(
        'a Gaussian process per joint, rigid-body features and squared exponential',
        'single_output',
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

    ConfigError if there is no such method or its URDF is missing, DataError or OSError if that
    cannot be read, LipIdError if a package is missing.

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


def _module(name: str) -> Any:
    try:
        return import_module(f'benchmarks.baselines.{LITERATURE[name].module}')
    except ImportError as error:
        raise LipIdError(
            f'the model {name!r} needs a package that is missing ({error}); '
            'install it with `pip install torch`.'
        ) from error
