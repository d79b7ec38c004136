"""Cholesky factors on a device, with the jitter of `lip_id_ros.linear_algebra`."""

from __future__ import annotations

from typing import Any

import torch

from lip_id_ros.errors import FitError
from lip_id_ros.linear_algebra import JITTERS, NOT_FINITE, NOT_POSITIVE_DEFINITE

Tensor = Any


def cholesky(matrix: Tensor) -> Tensor:
    """
    Factorise a matrix, with as little jitter as it takes.

    Parameters
    ----------
    matrix : tensor, shape (m, m)
        Only the lower triangle is read; left as it is.

    Raises
    ------
    FitError
        If the matrix is not finite or not positive definite even with jitter.

    """
    if not torch.isfinite(matrix.sum()):
        raise FitError(NOT_FINITE)
    scale = matrix.diagonal().mean()
    for relative in JITTERS:
        work = matrix.clone()
        work.diagonal().add_(relative * scale)
        lower, info = torch.linalg.cholesky_ex(work)
        if int(info) == 0:
            return lower
    raise FitError(NOT_POSITIVE_DEFINITE)
