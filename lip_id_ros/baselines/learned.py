"""A model of the literature as `lip_id fit --model` writes it: one file, loaded as it was."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import os
import time
from typing import Any

from lip_id_ros.arrays import Array
from lip_id_ros.baselines.interface import Answer, Estimator
from lip_id_ros.baselines.registry import method, Urdf
from lip_id_ros.baselines.taken_apart import put_together, take_apart
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import LipIdError
from lip_id_ros.model.checked_file import COMPARED, contradiction, read_checked, write_checked
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings

VERSION = 1


@dataclass(frozen=True, eq=False)
class Learned:
    """
    What a method of the literature made of a data set.

    Attributes
    ----------
    method : str
        One of `lip_id_ros.baselines.MODELS`.
    estimator : Estimator
    joint_names, joint_types : tuple of str
        From base to tip.
    n_samples : int
        Samples that were there to learn from.
    fit_seconds : float
        What the fit took [s].
    provenance : mapping
        JSON-able: where the data came from.

    """

    method: str
    estimator: Estimator
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    n_samples: int
    fit_seconds: float
    provenance: Mapping[str, Any]

    def predict(self, q: Array, dq: Array, ddq: Array) -> Answer:
        """Estimate torques, and energies where the method has them, of motions (N, n)."""
        return self.estimator.predict(q, dq, ddq)

    def save(self, path: str | os.PathLike[str]) -> None:
        """
        Write the model into one npz file, whole or not at all.

        Raises
        ------
        OSError
            If the file cannot be written.

        """
        arrays, objects = take_apart(self.estimator)
        header = {
            'method': self.method,
            'joint_names': list(self.joint_names),
            'joint_types': list(self.joint_types),
            'n_samples': self.n_samples,
            'fit_seconds': self.fit_seconds,
            'provenance': dict(self.provenance),
            'objects': objects,
        }
        write_checked(path, COMPARED, VERSION, arrays, header)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Learned:
        """
        Read a model.

        Raises
        ------
        OSError
            If the file does not exist or cannot be opened.
        ModelError
            If it is damaged, is no model of the literature, or comes from another version.
        ImportError
            If a package that the method needs is missing.

        """
        arrays, header = read_checked(path, COMPARED, VERSION)
        try:
            return cls(
                header['method'],
                put_together(arrays, header['objects']),
                tuple(header['joint_names']),
                tuple(header['joint_types']),
                header['n_samples'],
                header['fit_seconds'],
                header['provenance'],
            )
        except (KeyError, IndexError, TypeError, ValueError, LipIdError) as error:
            raise contradiction(path, error) from error


def learn(
    name: str, dataset: Dataset, settings: FitSettings, urdf: Urdf | None, progress: Progress
) -> Learned:
    """
    Fit a method of the literature.

    Parameters
    ----------
    name : str
        One of `lip_id_ros.baselines.MODELS`.
    dataset : Dataset
    settings : FitSettings
    urdf : path, optional
        Robot description, for those that need one.
    progress : Progress

    Raises
    ------
    LipIdError
        If there is no such method, something that it needs is missing, or the fit fails.
    OSError
        If the URDF cannot be opened.

    """
    started = time.perf_counter()
    estimator = method(name, urdf).fit(dataset, settings, progress)
    seconds = time.perf_counter() - started
    return Learned(
        name,
        estimator,
        dataset.joint_names,
        dataset.joint_types,
        dataset.n_samples,
        seconds,
        dataset.provenance,
    )
