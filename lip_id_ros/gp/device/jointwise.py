"""The covariances of `lip_id_ros.kernels.jointwise` on tensors."""

from __future__ import annotations

from typing import Any

Tensor = Any


def friction(parameters: Tensor, x: Tensor, z: Tensor) -> Tensor:
    """Return the covariances of friction torques, shape (n, N, M)."""
    return (x * parameters[:, None, :]) @ z.transpose(1, 2)


def residual(parameters: Tensor, x: Tensor, z: Tensor) -> Tensor:
    """Return the covariances of residual torques, shape (n, N, M)."""
    norms = (x * x).sum(-1)[:, :, None] + (z * z).sum(-1)[:, None, :]
    distances = (norms - 2.0 * x @ z.transpose(1, 2)).clamp_min(0.0)
    precision = 0.5 / parameters[:, 1:, None, None] ** 2
    return parameters[:, 0, None, None] * (-(precision * distances).sum(1)).exp()


COVARIANCES = {function.__name__: function for function in (friction, residual)}
"""By the name of the jointwise kernel."""
