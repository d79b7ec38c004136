"""Torque covariances of all pairs of samples, as tensors that torch can differentiate."""

from __future__ import annotations

from typing import Any

import torch

from lip_id_ros.gp.device import jets, products
from lip_id_ros.gp.device.factors import joint_factor
from lip_id_ros.gp.device.jointwise import COVARIANCES
from lip_id_ros.gp.device.states import TensorStates
from lip_id_ros.kernels import EnergyKernel, Hyperparameters, TorqueKernel, Weights
from lip_id_ros.kernels.program import ADD, MULTIPLY, RESET, SQUARE

Tensor = Any


def cross_gram(
    kernel: TorqueKernel, at: Hyperparameters, x: TensorStates, z: TensorStates
) -> Tensor:
    """
    Covariances between noiseless torques at two sets of samples.

    Parameters
    ----------
    kernel : TorqueKernel
    at : Hyperparameters
        With tensors in place of arrays.
    x, z : TensorStates
        N and M samples.

    Returns
    -------
    tensor, shape (N n, M n)
        Row t n + i is torque i of sample t [(N m)^2 or N^2].

    """
    blocks = _kinetic(kernel.energy, at.weights, x, z)
    if len(kernel.energy.potential_links):
        blocks = blocks + _potential(kernel.energy, at.weights, x, z)
    for k, term in enumerate(kernel.jointwise):
        each = COVARIANCES[term.name](at.jointwise[k], x.jointwise[k], z.jointwise[k])
        blocks = blocks + torch.diag_embed(each.permute(1, 2, 0))
    n = kernel.energy.n_joints
    return blocks.permute(0, 2, 1, 3).reshape(len(blocks) * n, -1)


def _kinetic(energy: EnergyKernel, weights: Weights, x: TensorStates, z: TensorStates) -> Tensor:
    y = jets.zero(x, z)
    total: Tensor = 0.0
    for operation, b, group, scale, _, _ in energy.kinetic.tolist():
        if operation == RESET:
            y = jets.zero(x, z)
        elif operation == MULTIPLY:
            y = jets.multiply(y, joint_factor(weights.factors[group, b], x, z, b), b)
        elif operation == ADD:
            y = jets.add_velocity(y, weights.velocities[group, b], x, z, b)
        elif operation == SQUARE:
            size = weights.kinetic_scales[int(energy.kinetic_links[scale])]
            total = total + float(energy.kinetic_signs[scale]) * size * jets.square(y)
    return total


def _potential(energy: EnergyKernel, weights: Weights, x: TensorStates, z: TensorStates) -> Tensor:
    product = products.one(x, z)
    links = energy.potential_links.tolist()
    total: Tensor = 0.0
    for b in range(energy.n_joints):
        product = products.extend(product, joint_factor(weights.potential_factors[b], x, z, b))
        if b in links:
            curvature = products.curvature(product, energy.n_joints)
            total = total + weights.potential_scales[links.index(b)] * curvature
    return total
