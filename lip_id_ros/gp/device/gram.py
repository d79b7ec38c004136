"""Torque covariances of all pairs of samples, as tensors that torch can differentiate."""

from __future__ import annotations

from typing import Any

import torch

from lip_id_ros.gp.device import entries, jets, products
from lip_id_ros.gp.device.factors import joint_factor, square
from lip_id_ros.gp.device.jointwise import COVARIANCES
from lip_id_ros.gp.device.states import TensorStates
from lip_id_ros.kernels import EnergyKernel, Hyperparameters, TorqueKernel, Weights
from lip_id_ros.kernels.program import ADD, EMIT, EXTEND, MULTIPLY, RESET, SQUARE, START

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
    terms = (_squares, _entries, _potential)
    blocks = sum(term(kernel.energy, at.weights, x, z) for term in terms)
    for k, term in enumerate(kernel.jointwise):
        each = COVARIANCES[term.name](at.jointwise[k], x.jointwise[k], z.jointwise[k])
        blocks = blocks + torch.diag_embed(each.permute(1, 2, 0))
    n = kernel.energy.n_joints
    gram = blocks.permute(0, 2, 1, 3).reshape(len(blocks) * n, -1)
    for one, other in zip(x.links, z.links, strict=True):  # without hyperparameters
        gram = gram + one.flatten(0, 1) @ other.flatten(0, 1).T
    return gram


def _squares(energy: EnergyKernel, weights: Weights, x: TensorStates, z: TensorStates) -> Tensor:
    y = jets.zero(x, z)
    total: Tensor = 0.0
    for operation, b, group, link, _, _ in energy.squares.tolist():
        if operation == RESET:
            y = jets.zero(x, z)
        elif operation == MULTIPLY:
            y = jets.multiply(y, joint_factor(weights.factors[group, b], x, z, b), b)
        elif operation == ADD:
            y = jets.add_velocity(y, weights.velocities[group, b], x, z, b)
        elif operation == SQUARE:
            total = total + weights.kinetic_scales[link] * jets.square(y)
    return total


def _entries(energy: EnergyKernel, weights: Weights, x: TensorStates, z: TensorStates) -> Tensor:
    product = products.one(x, z)
    total: Tensor = 0.0
    for operation, b, link, *bounds in energy.entries.tolist():
        if operation == START:
            product = products.one(x, z)
        elif operation == EXTEND:
            factor = joint_factor(weights.factors[link, b], x, z, b)
            product = products.extend(product, square(factor), b)
        elif operation == EMIT:
            block = entries.torque_block(product, weights.velocities[link], x, z, *bounds)
            total = total + weights.kinetic_scales[link] * block
    return total


def _potential(energy: EnergyKernel, weights: Weights, x: TensorStates, z: TensorStates) -> Tensor:
    product = products.one(x, z)
    links = energy.potential_links.tolist()
    total: Tensor = 0.0
    for b in range(energy.n_joints):
        factor = joint_factor(weights.potential_factors[b], x, z, b)
        product = products.extend(product, factor, b)
        if b in links:
            total = total + weights.potential_scales[links.index(b)] * product.h
    return total
