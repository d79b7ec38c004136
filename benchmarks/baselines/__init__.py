"""Models of the literature and ours, behind one interface, to be compared on the same data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
import os
from typing import Protocol

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError, LipIdError
from lip_id_ros.identification import fit
from lip_id_ros.model import TorqueModel, TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

Urdf = str | os.PathLike[str]

LITERATURE = {
    'se': 'single_output',
    'gip': 'single_output',
    'semiparametric': 'single_output',
    'rigid_body': 'rigid_body',
    'rigid_body_friction': 'rigid_body',
    'lse': 'lse',
    'delan': 'delan',
}
"""Modules of methods of the literature by name; comparison.md explains them."""

NEED_URDF = ('semiparametric', 'rigid_body', 'rigid_body_friction')
OURS = ('lip', 'recursive', 'articulated')
MODELS = (*LITERATURE, *OURS)
"""Names of all methods."""


class Baseline(ABC):
    """A model of the literature; a `lip_id_ros.model.TorqueModel`."""

    has_potential = False

    def __init__(self, joint_names: tuple[str, ...], joint_types: tuple[str, ...]) -> None:
        self.joint_names = tuple(joint_names)
        self.joint_types = tuple(joint_types)

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of numbers that the model keeps in order to predict."""

    @abstractmethod
    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        """Return torques, and energies where the model has them, at N joint states (N, n)."""


class Method(Protocol):
    """A way to learn inverse dynamics."""

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> TorqueModel:
        """
        Learn from a data set, by those of `subset`, `max_samples`, `friction`, `seed` that apply.

        DataError if the data do not suffice, FitError if the fit fails for numerical reasons.

        """


Methods = Mapping[str, Callable[[Urdf], Method]]
"""
What a module offers as `METHODS`: for each name a function from a robot description, which may be
empty where the method needs none, to the method.
"""


@dataclass(frozen=True)
class OurMethod:
    """The Gaussian processes and rigid links of this package; `kernel` as in `fit.kernel`."""

    kernel: str

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> TorqueModel:
        """Fit as `lip_id fit --kernel` does."""
        return fit(dataset, replace(settings, kernel=self.kernel), progress)


def method(name: str, urdf: Urdf | None = None) -> Method:
    """
    Return one of `MODELS` by its name; its packages are imported only now.

    ConfigError if there is no such method or its URDF is missing, DataError or OSError if that
    cannot be read, LipIdError if a package is missing.

    """
    if name in OURS:
        return OurMethod(name)
    if name not in LITERATURE:
        raise ConfigError(f'{name!r} is not a model; there are {", ".join(MODELS)}.')
    if name in NEED_URDF and urdf is None:
        raise ConfigError(
            f'the model {name!r} needs the kinematics of the robot; name its URDF file.'
        )
    try:
        module = import_module(f'benchmarks.baselines.{LITERATURE[name]}')
    except ImportError as error:
        raise LipIdError(
            f'the model {name!r} needs a package that is missing ({error}); '
            'install it with `pip install torch`.'
        ) from error
    methods: Methods = module.METHODS
    return methods[name](urdf or '')
