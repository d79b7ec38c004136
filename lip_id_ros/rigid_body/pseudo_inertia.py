"""
The pseudo-inertia of a link.

A 4 x 4 matrix that is positive definite where the link can exist. J = integral of rho (x, 1)(x,
1)^T is linear in the ten parameters (Wensing, Kim and Slotine 2018). J = S L L^T S^T with an
exponential diagonal of the lower triangular L is positive definite whatever the log-Cholesky
numbers of L are, and every such J has them (Rucker and Wensing, "Smooth Parameterization of
Rigid-Body Inertia", 2022).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array

BODY = 10
"""Parameters of a body: mass, first moments, inertias xx xy xz yy yz zz; no rotor."""

ROWS, COLUMNS = np.triu_indices(3)
"""Of the inertias xx xy xz yy yz zz."""


def pseudo_inertia(parameters: Array) -> Array:
    """
    Return the pseudo-inertias of links, shape (..., 4, 4).

    Parameters (..., 10) are mass, first moments, inertias xx xy xz yy yz zz about the origin of
    the frame; what comes after, as the inertia of the rotor, is ignored.
    """
    inertia = np.empty((*parameters.shape[:-1], 3, 3))
    inertia[..., ROWS, COLUMNS] = inertia[..., COLUMNS, ROWS] = parameters[..., 4:10]
    trace = np.trace(inertia, axis1=-2, axis2=-1)[..., None, None]
    out = np.empty((*parameters.shape[:-1], 4, 4))
    out[..., :3, :3] = 0.5 * trace * np.eye(3) - inertia
    out[..., 3, :3] = out[..., :3, 3] = parameters[..., 1:4]
    out[..., 3, 3] = parameters[..., 0]
    return out


UNIT_INERTIAS = pseudo_inertia(np.eye(BODY))
"""Pseudo-inertias of unit parameters, shape (10, 4, 4)."""


def from_pseudo_inertia(pseudo: Array) -> Array:
    """Return the ten parameters of links, shape (..., 10), from their pseudo-inertias."""
    second = pseudo[..., :3, :3]
    trace = np.trace(second, axis1=-2, axis2=-1)[..., None, None]
    inertia = trace * np.eye(3) - second
    return np.concatenate(
        [pseudo[..., 3, 3, None], pseudo[..., :3, 3], inertia[..., ROWS, COLUMNS]], axis=-1
    )


def in_other_frames(parameters: Array, rotations: Array, translations: Array) -> Array:
    """
    Re-express the parameters (n, 11) of links in other frames that are fixed to the same links.

    Rotations (n, 3, 3) are the axes of the new frames in the old ones, translations (n, 3) their
    origins [m]. The rotors' inertias are as before.
    """
    back = np.zeros((len(parameters), 4, 4))
    back[:, :3, :3] = rotations.transpose(0, 2, 1)
    back[:, :3, 3] = -np.einsum('iba,ib->ia', rotations, translations)
    back[:, 3, 3] = 1.0
    moved = back @ pseudo_inertia(parameters) @ back.transpose(0, 2, 1)
    return np.concatenate([from_pseudo_inertia(moved), parameters[:, 10:]], axis=1)


LOG_CHOLESKY = 11
"""Numbers of a link: the lower triangle of L, row by row, and half the logarithm of its rotor."""

LEAST_LEFT = 0.1
"""Share of a link's inertia in any direction that a step along a straight line may leave."""

_ROWS, _COLUMNS = np.tril_indices(4)
_DIAGONAL = np.flatnonzero(_ROWS == _COLUMNS)
_ROTOR = LOG_CHOLESKY - 1


_UNITS = from_pseudo_inertia(np.eye(16).reshape(4, 4, 4, 4)).transpose(2, 0, 1)
_PARAMETER_MAP = 0.5 * (_UNITS + _UNITS.transpose(0, 2, 1))
"""W, shape (10, 4, 4), with parameter k = sum(W[k] * J), each W[k] symmetric."""


class LinkScale(NamedTuple):
    """
    Links whose log-Cholesky numbers are all zero.

    `factors`, shape (n or 1, 4, 4), are lower triangular S, with the pseudo-inertia S S^T;
    `rotors`, shape (n or 1,), are inertias of the rotors.
    """

    factors: Array
    rotors: Array


def scale_of(mass: float, length: float) -> LinkScale:
    """Return the scale of links of about this mass [kg] and size [m]."""
    diagonal = np.sqrt(mass) * np.array([length, length, length, 1.0])
    return LinkScale(np.diag(diagonal)[None], np.array([mass * length**2]))


def link_parameters(numbers: Array, scale: LinkScale) -> Array:
    """
    Return the parameters (n, 11) of links from their log-Cholesky numbers (n, 11).

    As in `lip_id_ros.rigid_body.chain.LINK_PARAMETERS`; the rotor's inertia is positive.
    """
    factor = scale.factors @ _triangle(numbers)
    inertia = np.einsum('nab,ncb->nac', factor, factor)
    bodies = np.einsum('kab,nab->nk', _PARAMETER_MAP, inertia)
    return np.column_stack([bodies, scale.rotors * np.exp(2.0 * numbers[:, _ROTOR])])


def link_parameter_jacobian(numbers: Array, scale: LinkScale) -> Array:
    """Differentiate parameter k of each link by its number l, shape (n, 11, 11)."""
    triangle = _triangle(numbers)
    left = np.swapaxes(scale.factors, 1, 2)[:, None] @ _PARAMETER_MAP
    by_triangle = 2.0 * left @ (scale.factors @ triangle)[:, None]
    out = np.zeros((len(numbers), LOG_CHOLESKY, LOG_CHOLESKY))
    out[:, :_ROTOR, :_ROTOR] = by_triangle[..., _ROWS, _COLUMNS]
    out[:, :_ROTOR, _DIAGONAL] *= np.diagonal(triangle, axis1=1, axis2=2)[:, None, :]
    out[:, _ROTOR, _ROTOR] = 2.0 * scale.rotors * np.exp(2.0 * numbers[:, _ROTOR])
    return out


def moved(numbers: Array, step: Array) -> Array:
    """
    Return the numbers (n, 11) of links whose parameters move along a straight line.

    Torques are linear in the parameters of the links, so that a step along which no torque changes
    to first order then changes none at all. A link that would nearly cease to exist on that line
    moves by the step of its numbers instead.
    """
    out = numbers + step
    triangle = _triangle(numbers)
    change = np.zeros_like(triangle)
    change[:, _ROWS, _COLUMNS] = step[:, :_ROTOR]
    diagonal = np.arange(4)
    change[:, diagonal, diagonal] *= triangle[:, diagonal, diagonal]
    relative = np.linalg.solve(triangle, change)
    grown = np.eye(4) + relative + relative.transpose(0, 2, 1)
    exists = np.linalg.eigvalsh(grown)[:, 0] > LEAST_LEFT
    factor = triangle[exists] @ np.linalg.cholesky(grown[exists])
    factor[:, diagonal, diagonal] = np.log(factor[:, diagonal, diagonal])
    out[exists, :_ROTOR] = factor[:, _ROWS, _COLUMNS]
    rotor = 1.0 + 2.0 * step[:, _ROTOR]
    turns = rotor > LEAST_LEFT
    out[turns, _ROTOR] = numbers[turns, _ROTOR] + 0.5 * np.log(rotor[turns])
    return out


def log_cholesky(parameters: Array, scale: LinkScale, least: float = 1e-3) -> Array:
    """
    Return the log-Cholesky numbers (n, 11) of the nearest links that can exist.

    The parameters may be any, such as those of a linear least-squares problem. Eigenvalues of the
    scaled pseudo-inertia, and rotors, smaller than `least` are raised to it.
    """
    inverse = np.linalg.inv(scale.factors)
    scaled = inverse @ pseudo_inertia(parameters[:, :10]) @ np.swapaxes(inverse, 1, 2)
    values, vectors = np.linalg.eigh(scaled)
    raised = np.maximum(values, least)
    factor = np.linalg.cholesky(np.einsum('nab,nb,ncb->nac', vectors, raised, vectors))
    numbers = factor[:, _ROWS, _COLUMNS]
    numbers[:, _DIAGONAL] = np.log(numbers[:, _DIAGONAL])
    rotor = 0.5 * np.log(np.maximum(parameters[:, _ROTOR] / scale.rotors, least))
    return np.column_stack([numbers, rotor])


def _triangle(numbers: Array) -> Array:
    out = np.zeros((len(numbers), 4, 4))
    out[:, _ROWS, _COLUMNS] = numbers[:, :_ROTOR]
    diagonal = np.arange(4)
    out[:, diagonal, diagonal] = np.exp(out[:, diagonal, diagonal])
    return out
