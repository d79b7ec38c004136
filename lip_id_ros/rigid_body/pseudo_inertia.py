"""
The pseudo-inertia of a link: a 4 x 4 matrix that is positive definite where the link can exist.

With density rho, J = integral of rho (x, 1)(x, 1)^T (Wensing, Kim and Slotine, "Linear Matrix
Inequalities for Physically Consistent Inertial Parameter Identification", 2018). It is linear in
the ten parameters of a link, and positive definite exactly where the mass is positive and the
principal moments of inertia about the centre of mass obey the strict triangle inequality.

"""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array

ROWS, COLUMNS = np.triu_indices(3)
"""Of the inertias xx xy xz yy yz zz."""


def pseudo_inertia(parameters: Array) -> Array:
    """
    Return the pseudo-inertias of links.

    Parameters
    ----------
    parameters : array, shape (..., 10) or more
        Mass, first moments, inertias xx xy xz yy yz zz about the origin of the frame; what comes
        after, as the inertia of the rotor, is ignored.

    Returns
    -------
    array, shape (..., 4, 4)

    """
    inertia = np.empty((*parameters.shape[:-1], 3, 3))
    inertia[..., ROWS, COLUMNS] = inertia[..., COLUMNS, ROWS] = parameters[..., 4:10]
    trace = np.trace(inertia, axis1=-2, axis2=-1)[..., None, None]
    out = np.empty((*parameters.shape[:-1], 4, 4))
    out[..., :3, :3] = 0.5 * trace * np.eye(3) - inertia
    out[..., 3, :3] = out[..., :3, 3] = parameters[..., 1:4]
    out[..., 3, 3] = parameters[..., 0]
    return out


def link_parameters(pseudo: Array) -> Array:
    """Return the ten parameters of links, shape (..., 10), from their pseudo-inertias."""
    second = pseudo[..., :3, :3]
    trace = np.trace(second, axis1=-2, axis2=-1)[..., None, None]
    inertia = trace * np.eye(3) - second
    return np.concatenate(
        [pseudo[..., 3, 3, None], pseudo[..., :3, 3], inertia[..., ROWS, COLUMNS]], axis=-1
    )


def in_other_frames(parameters: Array, rotations: Array, translations: Array) -> Array:
    """
    Re-express the parameters of links in other frames that are fixed to the same links.

    Parameters
    ----------
    parameters : array, shape (n, 11)
    rotations : array, shape (n, 3, 3)
        The axes of the new frames in the old ones.
    translations : array, shape (n, 3)
        The origins of the new frames in the old ones [m].

    Returns
    -------
    array, shape (n, 11)
        The rotors' inertias are as before.

    """
    back = np.zeros((len(parameters), 4, 4))
    back[:, :3, :3] = rotations.transpose(0, 2, 1)
    back[:, :3, 3] = -np.einsum('iba,ib->ia', rotations, translations)
    back[:, 3, 3] = 1.0
    moved = back @ pseudo_inertia(parameters) @ back.transpose(0, 2, 1)
    return np.concatenate([link_parameters(moved), parameters[:, 10:]], axis=1)
