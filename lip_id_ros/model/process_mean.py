"""Posterior means of Gaussian processes at joint states, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.kernels.program import kernel_arrays, KernelArrays
from lip_id_ros.kernels.torque_process import friction_coefficients, TorquePosterior
from lip_id_ros.model.contraction import (
    kinetic_energy,
    new_scratch,
    potential_energy,
    Scratch,
    TrainingSide,
)
from lip_id_ros.model.torque_model import Parts
from lip_id_ros.numba_jit import jit, LANES

KINETIC, GRAVITY, FRICTION = 0, 1, 2
"""Parts of the torque: of kinetic energy (inertial and Coriolis), of gravity, of friction."""


class Arm(NamedTuple):
    """What the joint features of a query need, shapes (n,)."""

    prismatic: BoolArray
    centre: Array
    half_range: Array


class FrictionMean(NamedTuple):
    """
    Posterior mean of friction.

    Viscous, Coulomb, offset, (n, 3); zero without a friction kernel.
    """

    coefficients: Array
    sign_width: Array


class Contracted(NamedTuple):
    """A posterior mean, laid out for compiled code."""

    arm: Arm
    k: KernelArrays
    side: TrainingSide
    friction: FrictionMean


class ProcessMean:
    """
    Posterior mean of Gaussian processes on energies and friction.

    `one` is hot: no checks, nothing allocated but the result; not for several threads at once.
    """

    def __init__(self, posterior: TorquePosterior) -> None:
        self._contracted = contract(posterior)
        n = posterior.tau.shape[1]
        self._work = new_scratch(self._contracted.k)
        self._features = np.empty((4, n))
        self._energies = np.empty(2)
        self._state = np.zeros((3, n))

    def one(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, float, float]:
        """Return torques, gravity torques, T and V at one joint state."""
        energies, state = self._energies, self._state
        parts = np.empty_like(state)
        # Copied, since numba would compile anew for arrays that are read-only or not contiguous.
        state[0], state[1], state[2] = q, dq, ddq
        evaluate_one(parts, energies, *self._contracted, self._work, self._features, *state)
        tau = parts[KINETIC] + parts[GRAVITY] + parts[FRICTION]
        return tau, parts[GRAVITY], float(energies[0]), float(energies[1])

    def many(self, q: Array, dq: Array, ddq: Array) -> Parts:
        """Return the parts of the torques, and T and V, at contiguous (N, n)."""
        parts, energies = self._evaluated(q, dq, ddq)
        inertial = self._evaluated(q, np.zeros_like(dq), ddq)[0][:, KINETIC]
        coriolis, gravity, friction = (
            parts[:, KINETIC] - inertial,
            parts[:, GRAVITY],
            parts[:, FRICTION],
        )
        tau = parts.sum(axis=1)
        return Parts(tau, inertial, coriolis, gravity, friction, energies[:, 0], energies[:, 1])

    def _evaluated(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        parts, energies = np.empty((len(q), 3, q.shape[1])), np.empty((len(q), 2))
        work, features = new_scratch(self._contracted.k), np.empty((4, q.shape[1]))
        evaluate_many(parts, energies, *self._contracted, work, features, q, dq, ddq)
        return parts, energies


def contract(posterior: TorquePosterior) -> Contracted:
    """Lay a posterior mean out for `evaluate_one`."""
    basis = posterior.prior.kernel.basis
    return Contracted(
        arm=Arm(basis.prismatic, basis.centre, basis.half_range),
        k=kernel_arrays(posterior.prior.kernel.energy, posterior.prior.hyperparameters.weights),
        side=_training_side(posterior),
        friction=_friction_mean(posterior),
    )


def _training_side(posterior: TorquePosterior) -> TrainingSide:
    n_samples = len(posterior.states)
    extent = -(-n_samples // LANES) * LANES
    packed = posterior.states.packed
    f, g = packed.f[:, :, :extent], packed.g[:, :, :extent]
    dq, ddq = packed.dq[:, :extent], packed.ddq[:, :extent]
    alpha = np.zeros((posterior.tau.shape[1], extent))
    alpha[:, :n_samples] = posterior.alpha[:n_samples].T
    parts = (f, g * dq, g * alpha, dq, ddq, alpha)
    return TrainingSide(*(np.ascontiguousarray(part) for part in parts))


def _friction_mean(posterior: TorquePosterior) -> FrictionMean:
    kernel, parameters = posterior.prior.kernel.friction, posterior.prior.hyperparameters.friction
    features = posterior.states.friction
    if kernel is None or parameters is None or features is None:
        n = posterior.tau.shape[1]
        return FrictionMean(np.zeros((n, 3)), np.ones(n))
    coefficients = friction_coefficients(parameters, features, posterior.alpha)
    return FrictionMean(coefficients, kernel.sign_width)


@jit
def _features(f: Array, g: Array, arm: Arm, q: Array) -> None:
    for b in range(len(q)):
        if arm.prismatic[b]:
            f[0, b] = (q[b] - arm.centre[b]) / arm.half_range[b]
            f[1, b] = 0.0
            g[0, b] = 1.0 / arm.half_range[b]
            g[1, b] = 0.0
        else:
            f[0, b] = np.cos(q[b])
            f[1, b] = np.sin(q[b])
            g[0, b] = -f[1, b]
            g[1, b] = f[0, b]


@jit
def _friction(tau: Array, friction: FrictionMean, dq: Array) -> None:
    c = friction.coefficients
    for i in range(len(dq)):
        tau[i] += c[i, 0] * dq[i] + c[i, 1] * np.tanh(dq[i] / friction.sign_width[i]) + c[i, 2]


@jit
def evaluate_one(
    parts: Array,
    energies: Array,
    arm: Arm,
    k: KernelArrays,
    side: TrainingSide,
    friction: FrictionMean,
    work: Scratch,
    features: Array,
    q: Array,
    dq: Array,
    ddq: Array,
) -> None:
    """
    Evaluate one query.

    Torques of kinetic energy, gravity and friction, (3, n); energies, (2,). `features`, shape (4,
    n), is working memory.
    """
    f, g = features[:2], features[2:]
    _features(f, g, arm, q)
    parts[:] = 0.0
    energies[0] = kinetic_energy(parts[0], k, work, side, f, g, dq, ddq)
    energies[1] = potential_energy(parts[1], k, work, side, f, g)
    _friction(parts[2], friction, dq)


@jit
def evaluate_many(
    parts: Array,
    energies: Array,
    arm: Arm,
    k: KernelArrays,
    side: TrainingSide,
    friction: FrictionMean,
    work: Scratch,
    features: Array,
    q: Array,
    dq: Array,
    ddq: Array,
) -> None:
    """Evaluate N queries: `evaluate_one` for every row."""
    for t in range(q.shape[0]):
        evaluate_one(
            parts[t],
            energies[t],
            arm,
            k,
            side,
            friction,
            work,
            features,
            q[t],
            dq[t],
            ddq[t],
        )
