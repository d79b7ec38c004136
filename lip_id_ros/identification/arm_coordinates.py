"""Coordinates of fits: steps of placements, logarithms of friction that must be positive."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.pseudo_inertia import LEAST_LEFT


def moved_chain(chain: Chain, step: Array) -> Chain:
    """Return the placements after a step (6 n,): turns about joints' own axes, shifts [rad, m]."""
    turn, shift = step.reshape(-1, 2, 3).transpose(1, 0, 2)
    return chain._replace(
        rotations=chain.rotations @ Rotation.from_rotvec(turn).as_matrix(),
        translations=chain.translations + shift,
    )


def friction_numbers(coefficients: Array, positive: BoolArray, least: Array | float) -> Array:
    """Return the numbers of coefficients, shape (K,); positive ones count as `least` below it."""
    return np.where(positive, np.log(np.maximum(coefficients, least)), coefficients)


def friction_coefficients(numbers: Array, positive: BoolArray) -> Array:
    """Return the coefficients that numbers stand for, shape (K,)."""
    exponents = np.where(positive, numbers, 0.0)
    return np.where(positive, np.exp(exponents), numbers)


def straight_step(step: Array, positive: BoolArray) -> Array:
    """Return the change of numbers that changes coefficients as a step does at first, (K,)."""
    straight = positive & (step > LEAST_LEFT - 1.0)
    return np.where(straight, np.log1p(np.where(straight, step, 0.0)), step)


def coefficient_std(size: Array, torque_std: Array) -> Array:
    """
    Return deviations (K,) of coefficients that make torques of the measured size.

    Features of joints have root mean squares (n, K); of a drive that couples joints the smallest
    counts.
    """
    ratio = torque_std[:, None] / np.where(size > 0.0, size, np.nan)
    return np.nan_to_num(np.fmin.reduce(ratio, axis=0), nan=1.0)
