"""Hyperparameters as one vector of logarithms, which is what is optimised."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels import Hyperparameters, Weights


def arrays(hyperparameters: Hyperparameters) -> Iterator[tuple[str, Array]]:
    """Yield the name and values of every group of hyperparameters, in the order of the vector."""
    yield from zip(Weights._fields, hyperparameters.weights, strict=True)
    for k, parameters in enumerate(hyperparameters.per_joint):
        yield f'per_joint_{k}', parameters
    yield 'noise_variance', hyperparameters.noise_variance


def to_vector(hyperparameters: Hyperparameters) -> Array:
    """Return the logarithms of all hyperparameters, shape (p,)."""
    return np.concatenate([np.log(values).ravel() for _, values in arrays(hyperparameters)])


def from_vector(vector: Array, like: Hyperparameters) -> Hyperparameters:
    """Return the hyperparameters whose logarithms are `vector`, in the shapes of `like`."""
    parts = [part for _, part in _split(np.exp(vector), like)]
    count = len(Weights._fields)
    return Hyperparameters(Weights(*parts[:count]), tuple(parts[count:-1]), parts[-1])


def cosines_and_sines(like: Hyperparameters) -> tuple[IntArray, IntArray]:
    """Return where the vector has the weights of each factor's cosine, and those of its sine."""
    places = dict(_split(np.arange(to_vector(like).size), like))
    kinetic, potential = places['factors'], places['potential_factors']
    factors = np.concatenate([kinetic.reshape(-1, 3), potential])
    return factors[:, 1], factors[:, 2]


def _split(vector: NDArray[Any], like: Hyperparameters) -> Iterator[tuple[str, NDArray[Any]]]:
    start = 0
    for name, values in arrays(like):
        yield name, vector[start : start + values.size].reshape(values.shape)
        start += values.size


def names(like: Hyperparameters) -> list[str]:
    """Return a name such as ``velocities[0, 3]`` for every entry of the vector."""
    return [
        f'{name}{list(index)}'
        for name, values in arrays(like)
        for index in np.ndindex(values.shape)
    ]


def to_log_gradient(gradient: Hyperparameters, at: Hyperparameters) -> Array:
    """Turn derivatives by the hyperparameters into derivatives by their logarithms, shape (p,)."""
    pairs = zip(arrays(gradient), arrays(at), strict=True)
    return np.concatenate([(by * values).ravel() for (_, by), (_, values) in pairs])
