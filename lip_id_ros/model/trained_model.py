"""A prior conditioned on data: what serving needs, and nothing that fitting needed on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
import os
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import JointStates, TorquePrior
from lip_id_ros.model import model_file


@dataclass(frozen=True, eq=False)
class TrainedModel:
    """
    Gaussian process posterior of an arm's torques and energies.

    Attributes
    ----------
    joint_names : tuple of str
        From base to tip.
    prior : TorquePrior
        Kernels and optimised hyperparameters.
    states : JointStates
        The N samples that the posterior is conditioned on.
    tau : array, shape (N, n)
        Their measured torques [N m or N].
    alpha : array, shape (N, n)
        (K + noise)^-1 tau: the weights of the posterior mean.
    summary : mapping
        JSON-able: how the fit went, and `potential_reference`, the positions at which V is zero.
    provenance : mapping
        JSON-able: where the data came from.

    """

    joint_names: tuple[str, ...]
    prior: TorquePrior
    states: JointStates
    tau: Array
    alpha: Array
    summary: Mapping[str, Any] = field(default_factory=dict)
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def joint_types(self) -> tuple[str, ...]:
        """'revolute' or 'prismatic', from base to tip."""
        return self.prior.kernel.basis.joint_types

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    @property
    def n_samples(self) -> int:
        """Number of samples N that the posterior is conditioned on."""
        return len(self.states)

    @property
    def kernel(self) -> str:
        """Name of the energy kernel, or 'articulated' where rigid links are beside it."""
        return self.prior.kernel.name

    @property
    def noise_std(self) -> Array:
        """Standard deviation of each torque's measurement noise, shape (n,) [N m or N]."""
        return np.sqrt(self.prior.hyperparameters.noise_variance)

    @property
    def has_potential(self) -> bool:
        """Whether the potential energy can be told: not from gravity-compensated torques."""
        return self.prior.kernel.has_potential

    @property
    def potential_reference(self) -> Array:
        """Positions at which the potential energy is zero, shape (n,) [rad or m]."""
        return np.asarray(self.summary['potential_reference'], dtype=np.float64)

    def save(self, path: str | os.PathLike[str]) -> None:
        """
        Write the model into one npz file, whole or not at all.

        Raises
        ------
        OSError
            If the file cannot be written.

        """
        model_file.write(path, self)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> TrainedModel:
        """
        Read a model.

        Raises
        ------
        OSError
            If the file does not exist or cannot be opened.
        ModelError
            If it is damaged, is no model, or comes from a newer version of the format.

        """
        return cls(**model_file.read(path))
