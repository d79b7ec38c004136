"""Interfaces of baselines (`Baseline`) and of the methods that fit them (`Method`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import os
from typing import Any, Protocol

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.model import TorqueModel, TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

State = Mapping[str, Any]
"""Numbers, texts, arrays, and lists and mappings of these."""

Joints = tuple[tuple[str, ...], tuple[str, ...]]
"""Names and types of the joints."""

Urdf = str | os.PathLike[str]


@dataclass(frozen=True)
class FitRecord:
    """Method (of `MODELS`), number of samples, duration [s] and JSON-able origin of a fit."""

    method: str = ''
    n_samples: int = 0
    seconds: float = 0.0
    provenance: Mapping[str, Any] = field(default_factory=dict)


class Baseline(ABC):
    """
    A model of the literature; a `lip_id_ros.model.TorqueModel`.

    `record` is set by `lip_id_ros.baselines.learn`.

    """

    has_potential = False

    def __init__(self, joint_names: tuple[str, ...], joint_types: tuple[str, ...]) -> None:
        self.joint_names = tuple(joint_names)
        self.joint_types = tuple(joint_types)
        self.record = FitRecord()

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    @property
    def provenance(self) -> Mapping[str, Any]:
        """Origin of the training data."""
        return self.record.provenance

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of numbers that the model keeps in order to predict."""

    @abstractmethod
    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        """Return torques, and energies where the model has them, at N joint states (N, n)."""

    @abstractmethod
    def state(self) -> State:
        """Return everything that `predict` needs beside the joints, for a file."""


class Method(Protocol):
    """A way to learn inverse dynamics."""

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> TorqueModel:
        """
        Learn from a data set, by those of `subset`, `max_samples`, `friction`, `seed` that apply.

        Raises
        ------
        DataError
            If the data do not suffice.
        FitError
            If fitting fails for numerical reasons.

        """


Methods = Mapping[str, Callable[[Urdf], Method]]
"""
What a module offers as `METHODS`: for each name a function from a robot description, which may be
empty where the method needs none, to the method. Its `read(joints, state)` restores the models.
"""
