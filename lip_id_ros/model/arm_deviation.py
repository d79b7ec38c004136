"""Standard deviations of the torques of an arm, compiled."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, IndexArray, IntArray
from lip_id_ros.friction.compiled import CompiledFriction, set_features, set_load_slopes
from lip_id_ros.model.arm_mean import pack, unpack_friction
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.numba_jit import in_threads, jit
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.rnea import unpack_links
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS, placement_derivatives

FEW, CHUNK = 20, 2000
"""States whose deviations a compiled loop computes; of more, so many by one matrix product."""


class ArmDeviation:
    """
    Posterior standard deviations of torques: norms of Jacobian times root of the covariance.

    Construction lays the posterior out; nothing is checked after that.
    """

    def __init__(self, arm: ArmPosterior) -> None:
        self._used = np.flatnonzero(arm.covariance_root.any(axis=1))
        self._root = np.ascontiguousarray(arm.covariance_root[self._used])
        reversed_rows = self._root[:, ::-1] != 0.0
        self._ends = self._root.shape[1] - np.argmax(reversed_rows, axis=1)
        friction = arm.friction.with_shapes()
        self._packed = (
            *pack(arm, CompiledFriction.features_of(friction.basis)),
            np.flatnonzero(friction.basis.is_loaded),
            friction.coefficients,
        )

    def torque_std(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return standard deviations of the noiseless torques, (N, n) [N m or N]."""
        q, dq, ddq = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq))
        out = np.empty(q.shape)
        if len(out) <= FEW:
            spread_by_rows(out, q, dq, ddq, *self._packed, self._used, self._root, self._ends)
            return out
        for start in range(0, len(out), CHUNK):
            rows = slice(start, start + CHUNK)
            spread = self._jacobian(q[rows], dq[rows], ddq[rows]) @ self._root
            out[rows] = np.sqrt(np.einsum('tik,tik->ti', spread, spread))
        return out

    def _jacobian(self, q: Array, dq: Array, ddq: Array) -> Array:
        out = np.empty((*q.shape, self._used.size))

        def evaluate(rows: slice) -> None:
            used_jacobian(out[rows], q[rows], dq[rows], ddq[rows], *self._packed, self._used)

        in_threads(evaluate, len(out))
        return out


@jit
def used_jacobian(
    out: Array,
    q: Array,
    dq: Array,
    ddq: Array,
    floats: Array,
    integers: IntArray,
    loaded: IndexArray,
    coefficients: Array,
    used: IndexArray,
) -> None:
    """
    Differentiate torques, (N, n, p), by the coordinates `used`, shape (p,), of `ArmPosterior`.

    Numbers are by `pack`, with the features of friction; `loaded` are those that depend on a load.
    """
    n = integers[0]
    chain, links = unpack_links(floats[: integers[1]], integers[4 : 4 + n])
    features = unpack_friction(floats, integers)
    placements = placement_derivatives(chain, links, q, dq, ddq)
    regressor = torque_regressor(chain, q, dq, ddq)
    first, last = DIRECTIONS * n, (DIRECTIONS + LINK_PARAMETERS) * n
    own, load = np.empty((n, len(features.ends))), np.empty(n)
    steady = np.zeros(len(features.ends))
    slopes, by_load = np.empty((n, n)), np.empty(n)
    parameters = links.ravel()
    for t in range(len(out)):
        for i in range(n):
            load[i] = 0.0
            for c in range(LINK_PARAMETERS * n):
                load[i] += regressor[t, i, c] * parameters[c]
        set_features(features, q[t], dq[t], ddq[t], load, steady, own)
        state = q[t], dq[t], ddq[t], load
        set_load_slopes(features, loaded, coefficients, *state, slopes)
        for k in range(len(used)):
            at = used[k]
            for i in range(n):
                if at < first:
                    out[t, i, k] = placements[t, i, at // DIRECTIONS, at % DIRECTIONS]
                elif at < last:
                    out[t, i, k] = regressor[t, i, at - first]
                else:
                    out[t, i, k] = own[i, at - last]
            if at < last and len(loaded) > 0:
                by_load[:] = out[t, :, k]
                for i in range(n):
                    for j in range(n):
                        out[t, i, k] += slopes[i, j] * by_load[j]


@jit
def spread_by_rows(
    out: Array,
    q: Array,
    dq: Array,
    ddq: Array,
    floats: Array,
    integers: IntArray,
    loaded: IndexArray,
    coefficients: Array,
    used: IndexArray,
    root: Array,
    ends: IndexArray,
) -> None:
    """
    Set `out`, shape (N, n), to the norms of the rows of Jacobian times `root`.

    Row k of the root, shape (p, r), has nothing but zeros from column `ends[k]` on.
    """
    jacobian = np.empty((*out.shape, len(used)))
    used_jacobian(jacobian, q, dq, ddq, floats, integers, loaded, coefficients, used)
    spread = np.empty(root.shape[1])
    for t in range(len(out)):
        for i in range(out.shape[1]):
            spread[:] = 0.0
            for k in range(len(used)):
                by = jacobian[t, i, k]
                if by != 0.0:
                    for c in range(ends[k]):
                        spread[c] += by * root[k, c]
            total = 0.0
            for c in range(len(spread)):
                total += spread[c] * spread[c]
            out[t, i] = np.sqrt(total)
