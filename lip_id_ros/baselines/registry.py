"""Methods by name; the packages of a method are imported only when it is used."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import import_module
import time
from typing import Any

from lip_id_ros.baselines.interface import Baseline, FitRecord, Joints, Method, State, Urdf
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError, LipIdError
from lip_id_ros.identification import fit
from lip_id_ros.model import TorqueModel
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings


@dataclass(frozen=True)
class Energies:
    """
    The Gaussian processes and rigid links of this package.

    Attributes
    ----------
    kernel : str
        As in `fit.kernel`.

    """

    kernel: str

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> TorqueModel:
        """Fit as `lip_id fit --kernel` does."""
        return fit(dataset, replace(settings, kernel=self.kernel), progress)


@dataclass(frozen=True)
class Entry:
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
    'se': Entry('a Gaussian process per joint, squared exponential', 'single_output'),
    'gip': Entry(
        'a Gaussian process per joint, geometrically inspired polynomial kernel', 'single_output'
    ),
    'lse': Entry('a Gaussian process on the Lagrangian, squared exponential', 'lse'),
    'delan': Entry('a deep Lagrangian network', 'delan'),
    'rigid_body': Entry(
        'least squares on rigid-body dynamics with smooth friction, kinematics known from a URDF',
        'rigid_body',
        version=2,
        needs_urdf=True,
    ),
    'rigid_body_friction': Entry(
        'the same with the friction terms of the default fit, elected joint by joint',
        'rigid_body_friction',
        needs_urdf=True,
    ),
    'semiparametric': Entry(
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
    Return a method by its name.

    Parameters
    ----------
    name : str
        One of `MODELS`.
    urdf : path, optional
        Robot description, for a method that needs one.

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
        return Energies(name)
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
    Fit a method of the literature.

    Parameters
    ----------
    name : str
        A key of `LITERATURE`.
    dataset : Dataset
    settings : FitSettings
    urdf : path, optional
        Robot description, for a method that needs one.
    progress : Progress

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


def restore(name: str, joints: Joints, state: State) -> Baseline:
    """
    Return the model of a method from the state that it wrote.

    Raises
    ------
    KeyError, TypeError, ValueError
        If there is no such method, or the state is not one of its models.
    LipIdError
        If a package is missing.

    """
    model: Baseline = _module(name).read(joints, state)
    return model


def _module(name: str) -> Any:
    try:
        return import_module(f'lip_id_ros.baselines.{LITERATURE[name].module}')
    except ImportError as error:
        raise LipIdError(
            f'the model {name!r} needs a package that is missing ({error}); '
            "install it with `pip install 'lip_id_ros[torch]'`."
        ) from error
