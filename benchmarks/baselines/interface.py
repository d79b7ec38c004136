"""Interfaces of baselines (`Baseline`) and of the methods that fit them (`Method`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
import os
from typing import Protocol

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.model import TorqueModel, TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

Urdf = str | os.PathLike[str]


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
