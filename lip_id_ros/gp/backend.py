"""Where the likelihood is evaluated: by compiled loops on the CPU, or by torch on a device."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Protocol

from lip_id_ros.arrays import Array
from lip_id_ros.gp.likelihood import Likelihood, MarginalLikelihood
from lip_id_ros.kernels import Hyperparameters, JointStates, TorqueKernel


class MakeLikelihood(Protocol):
    """Makes a likelihood of N samples with torques tau, shape (N, n)."""

    def __call__(
        self, kernel: TorqueKernel, states: JointStates, tau: Array, like: Hyperparameters
    ) -> Likelihood:
        """Return the likelihood; `like` gives the shapes of the hyperparameters."""


@dataclass(frozen=True)
class Backend:
    """
    What evaluates the likelihood.

    Attributes
    ----------
    device : str
        'cpu' or 'cuda'.
    likelihood : callable
    note : str
        Why this is not the device that was asked for; empty where it is.

    """

    device: str
    likelihood: MakeLikelihood
    note: str = ''


def choose(device: str) -> Backend:
    """
    Return what evaluates the likelihood on a device, or on the CPU where that is missing.

    Parameters
    ----------
    device : str
        'cpu' or 'cuda'.

    """
    if device == 'cpu':
        return Backend('cpu', MarginalLikelihood)
    try:
        torch_path = import_module('lip_id_ros.gp.device')
    except ImportError as error:
        return _instead(device, f'torch cannot be imported ({error})')
    if not torch_path.is_available():
        return _instead(device, 'torch finds no CUDA device')
    return Backend(device, torch_path.likelihood_on(device))


def _instead(device: str, reason: str) -> Backend:
    note = f'Fitted on the CPU instead of {device}: {reason}.'
    return Backend('cpu', MarginalLikelihood, note)
