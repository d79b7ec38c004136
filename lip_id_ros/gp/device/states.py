"""Joint states and hyperparameters as tensors."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch

from lip_id_ros.gp.log_vector import arrays
from lip_id_ros.kernels import Hyperparameters, JointStates, Weights

Tensor = Any  # torch is optional, also for the type checker


class TensorStates(NamedTuple):
    """
    Joint states on one side of all pairs.

    Attributes
    ----------
    f, g : tensors, shape (2, n, N)
        Features and their derivatives by the position.
    dq, ddq : tensors, shape (n, N)
        Velocities and accelerations.
    jointwise : tuple of tensors
        The inputs of each jointwise kernel; the second index is the sample.
    links : tuple of tensors, each of shape (N, n, k)
        The features of the torques of rigid links.

    """

    f: Tensor
    g: Tensor
    dq: Tensor
    ddq: Tensor
    jointwise: tuple[Tensor, ...]
    links: tuple[Tensor, ...]

    @classmethod
    def of(cls, x: JointStates, device: str) -> TensorStates:
        """Copy joint states, without their padding, to a device."""
        f, g, dq, ddq = (torch.tensor(v[..., : len(x)], device=device) for v in x.packed)
        jointwise = tuple(torch.tensor(inputs, device=device) for inputs in x.jointwise)
        shape = (*x.q.shape, -1)
        links = tuple(torch.tensor(part.reshape(shape), device=device) for part in x.links)
        return cls(f, g, dq, ddq, jointwise, links)

    def some(self, samples: slice) -> TensorStates:
        """Return some of the samples."""
        f, g, dq, ddq = (values[..., samples] for values in self[:4])
        jointwise = tuple(inputs[:, samples] for inputs in self.jointwise)
        return TensorStates(f, g, dq, ddq, jointwise, tuple(part[samples] for part in self.links))


def hyperparameters(vector: Tensor, like: Hyperparameters) -> Hyperparameters:
    """Return the tensors whose logarithms are `vector`, in the shapes of `like`."""
    shapes = [values.shape for _, values in arrays(like)]
    pieces = vector.exp().split([values.size for _, values in arrays(like)])
    parts = [piece.reshape(shape) for piece, shape in zip(pieces, shapes, strict=True)]
    count = len(Weights._fields)
    return Hyperparameters(Weights(*parts[:count]), tuple(parts[count:-1]), parts[-1])
