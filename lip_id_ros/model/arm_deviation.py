"""Standard deviations of the torques and energies of an arm, compiled."""

from __future__ import annotations

import math

import numpy as np

from lip_id_ros.arrays import Array, IndexArray, IntArray
from lip_id_ros.friction.compiled import set_features, set_load_slopes
from lip_id_ros.model.arm_mean import pack, unpack_friction
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.numba_jit import in_threads, jit, jit_inlined
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)
from lip_id_ros.rigid_body.rnea import unpack_links
from lip_id_ros.rigid_body.rnea_derivatives import (
    DIRECTIONS,
    energy_derivatives,
    placement_derivatives,
)

FEW, CHUNK = 20, 2000
"""States whose deviations a compiled loop computes; of more, so many by one matrix product."""


class ArmDeviation:
    """
    Posterior standard deviations: norms of Jacobian times root of the covariance.

    Construction lays the posterior out; nothing is checked after that. `reference`, shape (n,):
    positions at which the potential energy is zero and certain.
    """

    def __init__(self, arm: ArmPosterior, reference: Array) -> None:
        self._used = np.flatnonzero(arm.covariance_root.any(axis=1))
        self._root = np.ascontiguousarray(arm.covariance_root[self._used])
        reversed_rows = self._root[:, ::-1] != 0.0
        self._ends = self._root.shape[1] - np.argmax(reversed_rows, axis=1)
        friction = arm.friction.with_shapes()
        self._packed = (
            *pack(arm, friction.basis.compiled),
            np.flatnonzero(friction.basis.is_loaded),
            friction.coefficients,
        )
        at = np.ascontiguousarray(reference[None])
        self._reference = energy_jacobian(arm.chain, arm.links, at, np.zeros_like(at))[0, 1]

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

    def energy_std(self, q: Array, dq: Array) -> tuple[Array, Array]:
        """Return standard deviations of both energies at (N, n) positions, velocities, (N,)."""
        q, dq = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq))
        out = np.empty((len(q), 2))
        of_links = self._used[: np.searchsorted(self._used, self._reference.size)]

        def evaluate(rows: slice) -> None:
            state, arm = (q[rows], dq[rows]), self._packed[:2]
            energy_spread(
                out[rows], *state, *arm, self._reference, of_links, self._root, self._ends
            )

        in_threads(evaluate, len(q))
        return out[:, 0], out[:, 1]

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
        set_features(features, q[t], dq[t], ddq[t], load, own)
        state = q[t], dq[t], ddq[t], load
        set_load_slopes(features, loaded, coefficients, *state, steady, slopes)
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
            out[t, i] = _spread(spread, jacobian[t, i], root, ends)


@jit_inlined
def _spread(work: Array, row: Array, root: Array, ends: IndexArray) -> float:
    work[:] = 0.0
    for k in range(len(row)):
        by = row[k]
        if by != 0.0:
            for c in range(ends[k]):
                work[c] += by * root[k, c]
    total = 0.0
    for c in range(len(work)):
        total += work[c] * work[c]
    return math.sqrt(total)


@jit
def energy_jacobian(chain: Chain, links: Array, q: Array, dq: Array) -> Array:
    """Differentiate both energies by placements, then by link parameters, (N, 2, 17 n) [J]."""
    count, n = q.shape
    first = DIRECTIONS * n
    out = np.empty((count, 2, first + LINK_PARAMETERS * n))
    kinetic, potential = energy_derivatives(chain, links, q, dq)
    out[:, 0, :first], out[:, 0, first:] = (
        kinetic.reshape(count, first),
        kinetic_regressor(chain, q, dq),
    )
    out[:, 1, :first], out[:, 1, first:] = (
        potential.reshape(count, first),
        potential_regressor(chain, q),
    )
    return out


@jit
def energy_spread(
    out: Array,
    q: Array,
    dq: Array,
    floats: Array,
    integers: IntArray,
    reference: Array,
    used: IndexArray,
    root: Array,
    ends: IndexArray,
) -> None:
    """
    Set `out`, shape (N, 2), to the deviations of both energies, root and ends as above.

    From the Jacobian of the potential energy that at its reference, shape (17 n,), is subtracted.
    """
    chain, links = unpack_links(floats[: integers[1]], integers[4 : 4 + integers[0]])
    jacobian = energy_jacobian(chain, links, q, dq)
    spread = np.empty(root.shape[1])
    for t in range(len(q)):
        jacobian[t, 1] -= reference
        for energy in range(2):
            out[t, energy] = _spread(spread, jacobian[t, energy][used], root, ends)
