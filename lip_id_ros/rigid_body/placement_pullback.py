"""
Gradients by the joint state of a weighted sum of the torques' derivatives by placements.

The weights of a torque displace the chain; so these are differences of its gradients at two
chains.
"""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit
from lip_id_ros.rigid_body.chain import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor_pullback import regressor_pullback
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

STEP = 1e-4
"""Largest rotation [rad] and translation [m] of the displaced chains."""


@jit
def placement_pullback(
    chain: Chain, parameters: Array, weights: Array, q: Array, dq: Array, ddq: Array
) -> Array:
    """
    Differentiate sums of weights times `placement_derivatives` by the joint states.

    `parameters`, shape (n, 11). `weights`, shape (N, n, 6 n). `q`, `dq`, `ddq`: contiguous, shape
    (N, n). The result has shape (3, N, n): by q, dq and ddq.
    """
    count, n = q.shape
    out = np.zeros((3, count, n))
    of_torque = np.zeros((1, n, LINK_PARAMETERS * n))
    there = Chain(np.empty((n, 3, 3)), np.empty((n, 3)), chain.prismatic, chain.gravity)
    for t in range(count):
        state = q[t : t + 1], dq[t : t + 1], ddq[t : t + 1]
        for i in range(n):
            largest = np.abs(weights[t, i]).max()
            if largest == 0.0:
                continue
            of_torque[:] = 0.0
            of_torque[0, i] = parameters.ravel()
            for sign in (1.0, -1.0):
                _displace(there, chain, sign * STEP / largest, weights[t, i])
                gradient = regressor_pullback(there, of_torque, *state)
                out[:, t] += 0.5 * sign * largest / STEP * gradient[:, 0]
    return out


@jit
def _displace(there: Chain, chain: Chain, step: float, direction: Array) -> None:
    """Set a chain whose placements have moved along a direction, shape (6 n,)."""
    for j in range(len(chain.translations)):
        turn = step * direction[DIRECTIONS * j : DIRECTIONS * j + 3]
        there.rotations[j] = chain.rotations[j] @ _rotation(turn)
        there.translations[j] = (
            chain.translations[j] + step * direction[DIRECTIONS * j + 3 : DIRECTIONS * (j + 1)]
        )


@jit
def _rotation(turn: Array) -> Array:
    """Return the rotation by a small vector, to second order (its error is odd)."""
    x, y, z = turn
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Array = np.eye(3) + skew + 0.5 * skew @ skew
    return rotation
