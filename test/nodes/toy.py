"""Two decoupled pendulums: torques and energies in one line, and a model fitted in seconds."""

from __future__ import annotations

from dataclasses import replace

from made_once import made_once
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.settings import FitSettings

JOINTS = ('shoulder', 'elbow')
INERTIA = np.array([1.5, 0.6])  # kg m^2
WEIGHT = np.array([8.0, 3.0])  # N m
RATE_HZ = 100.0
LIMIT = 1e6  # N m, beyond all torques of the tests
CHEAP = FitSettings(subset=30, max_samples=60, iterations=15, friction=False)


def torque(q: Array, ddq: Array) -> Array:
    return np.asarray(INERTIA * ddq + WEIGHT * np.sin(q))


def kinetic(dq: Array) -> Array:
    return np.asarray(0.5 * dq**2 @ INERTIA)


def motion(n_samples: int, seed: int = 0) -> tuple[Array, Array, Array, Array]:
    """Times, positions, velocities, accelerations of a sum of three sinusoids per joint."""
    rng = np.random.default_rng(seed)
    t = np.arange(n_samples) / RATE_HZ
    omega = np.array([1.0, 2.3, 4.1])[:, np.newaxis, np.newaxis]
    amplitude, phase = rng.uniform(0.2, 0.5, (3, 1, 2)), rng.uniform(0, 6, (3, 1, 2))
    angle = omega * t[:, np.newaxis] + phase
    q = (amplitude * np.sin(angle)).sum(axis=0)
    dq = (amplitude * omega * np.cos(angle)).sum(axis=0)
    ddq = -(amplitude * omega**2 * np.sin(angle)).sum(axis=0)
    return t, q, dq, ddq


def dataset(joints: tuple[str, ...] = JOINTS) -> Dataset:
    t, q, dq, ddq = motion(600)
    tau = torque(q, ddq) + 1e-3 * np.random.default_rng(1).standard_normal(q.shape)
    return Dataset.from_arrays(q, dq, ddq, tau, joints, t=t)


def model(joints: tuple[str, ...] = JOINTS) -> InverseDynamicsModel:
    """Fit, and compile what answers, so that no node has to while a test waits."""
    fitted = fit(dataset(joints), CHEAP)
    fitted.predict(*np.zeros((3, 1, 2)))
    return fitted


def model_path(factory: pytest.TempPathFactory) -> str:
    return str(made_once(factory, 'toy.npz', lambda path: model().save(path)))


def heavier(model: InverseDynamicsModel) -> InverseDynamicsModel:
    """Return a model whose links have twice the mass."""
    assert model.arm is not None
    return replace(model, arm=replace(model.arm, links=2.0 * model.arm.links))
