"""Hyperparameters of the torque prior, and their logarithms as one vector, which is optimised."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels.program import Weights


@dataclass(frozen=True)
class Hyperparameters:
    """
    Everything that is optimised; all numbers positive.

    `friction` has shape (n, 3), None without friction; `noise_variance` (n,) [(N m)^2 or N^2].

    """

    weights: Weights
    friction: Array | None
    noise_variance: Array

    def groups(self) -> dict[str, Array]:
        """Return every group of hyperparameters by its name, in the order of the vector."""
        own = {} if self.friction is None else {'friction': self.friction}
        return {**self.weights._asdict(), **own, 'noise_variance': self.noise_variance}

    def vector(self) -> Array:
        """Return the logarithms of all hyperparameters, shape (p,)."""
        return np.concatenate([np.log(values).ravel() for values in self.groups().values()])

    def with_vector(self, vector: Array) -> Hyperparameters:
        """Return the hyperparameters whose logarithms are `vector`, in the shapes of these."""
        return self.filled([values for _, values in self._split(np.exp(vector))])

    def filled(self, groups: Sequence[Any]) -> Hyperparameters:
        """Return hyperparameters from groups in the order of `groups`: arrays or tensors."""
        count = len(Weights._fields)
        friction = None if self.friction is None else groups[count]
        return Hyperparameters(Weights(*groups[:count]), friction, groups[-1])

    def names(self) -> list[str]:
        """Return a name such as ``velocities[0, 3]`` for every entry of the vector."""
        return [
            f'{name}{list(index)}'
            for name, values in self.groups().items()
            for index in np.ndindex(values.shape)
        ]

    def cosines_and_sines(self) -> tuple[IntArray, IntArray]:
        """Return where the vector has the weights of the factors' cosines, and their sines."""
        size = sum(values.size for values in self.groups().values())
        places = dict(self._split(np.arange(size)))
        kinetic, potential = places['factors'], places['potential_factors']
        factors = np.concatenate([kinetic.reshape(-1, 3), potential])
        return factors[:, 1], factors[:, 2]

    def log_gradient(self, gradient: Hyperparameters) -> Array:
        """Turn derivatives by these numbers into those by their logarithms, shape (p,)."""
        pairs = zip(gradient.groups().values(), self.groups().values(), strict=True)
        return np.concatenate([(by * values).ravel() for by, values in pairs])

    def _split(self, vector: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
        start = 0
        for name, values in self.groups().items():
            yield name, vector[start : start + values.size].reshape(values.shape)
            start += values.size
