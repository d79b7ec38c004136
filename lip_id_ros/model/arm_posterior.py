"""An arm as a set of parameters with a joint posterior (maths.md, section 13)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr, solve_triangular

from lip_id_ros.arrays import Array
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS, placement_derivatives

MOST_CHANGE = 5e-4
"""Largest relative change of a deviation at random states that a compact posterior may make."""

TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-8)
"""Torques of coordinates that are left out, as shares of the largest torque of a coordinate."""

MOST_BITS = 24
"""Of a float32."""

STATES, SEED = 150, 0

LEAST_MOTION = 0.1
"""Velocities and accelerations of a joint at random states, at least, in the largest of all."""


@dataclass(frozen=True, eq=False)
class ArmPosterior:
    """
    Chain, links and friction of an arm with their joint covariance.

    Its coordinates are: small rotations about the axes of each joint's own frame and translations
    in its parent, joint by joint (6 n); parameters of the links (11 n); coefficients of friction
    (K); the shapes of its terms (W, see `SignWidth`), where they are not taken as known.
    """

    chain: Chain
    links: Array  # (n, 11), of bodies that can exist
    friction: FrictionModel
    noise: TorqueNoise  # of measured torques about the model
    covariance_root: Array  # S, (17 n + K (+ W), r): covariance S S^T

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """
        Return the torques of links and friction.

        `q`, `dq`, `ddq`, shape (N, n). The result has shape (N, n) [N m or N].
        """
        links = torque_regressor(self.chain, *_contiguous(q, dq, ddq)) @ self.links.ravel()
        return np.asarray(links + self.friction.torque(q, dq, ddq, links))

    def jacobian(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the torques by placements, links and coefficients, (N, n, 17 n + K)."""
        return self._jacobian(self.friction.basis, q, dq, ddq)

    def jacobian_of_coordinates(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the torques by the coordinates of the covariance [N m or N]."""
        whole = self._jacobian(self.friction.basis.with_shapes(), q, dq, ddq)
        return whole[..., : len(self.covariance_root)]

    def _jacobian(self, basis: FrictionBasis, q: Array, dq: Array, ddq: Array) -> Array:
        state = _contiguous(q, dq, ddq)
        regressor = torque_regressor(self.chain, *state)
        placements = placement_derivatives(self.chain, self.links, *state)
        load = regressor @ self.links.ravel()
        n, count = dq.shape[1] * DIRECTIONS, regressor.shape[2]
        out = np.empty((*dq.shape, n + count + basis.size))
        out[..., :n] = placements.reshape(*dq.shape, -1)
        out[..., n : n + count] = regressor
        slopes = self.friction.load_slopes(q, dq, ddq, load)
        if slopes.any():
            out[..., : n + count] += slopes @ out[..., : n + count]
        out[..., n + count :] = basis.features(q, dq, ddq, load)
        return out

    def torque_std(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return standard deviations of the noiseless torques, shape (N, n) [N m or N]."""
        spread = self.jacobian_of_coordinates(q, dq, ddq) @ self.covariance_root
        variance: Array = np.sum(spread**2, axis=2)
        return np.sqrt(variance)

    def measurement_std(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return standard deviations of measured torques, shape (N, n) [N m or N]."""
        return np.hypot(self.torque_std(q, dq, ddq), self.noise.std_at(dq))


def _contiguous(*arrays: Array) -> tuple[Array, ...]:
    return tuple(np.ascontiguousarray(x, dtype=np.float64) for x in arrays)


def compacted(arm: ArmPosterior, ranges: tuple[Array, Array]) -> ArmPosterior:
    """
    Return an arm with a covariance root of as few numbers and bits as its deviations need.

    Coordinates whose torques those of others can stand for have rows of zeros (QR factorisation
    with column pivoting: Golub and Van Loan, Matrix Computations, 4th ed., 5.4.2). The rest is
    triangular, and rounded to so many bits that no deviation of a torque at random states in the
    ranges (3, n) of q, dq, ddq changes by more than `MOST_CHANGE`.
    """
    rng = np.random.default_rng(SEED)
    basis, checks = (_random_states(arm, ranges, rng) for _ in range(2))
    expected = arm.torque_std(*checks)

    def change(root: Array) -> float:
        found = replace(arm, covariance_root=root).torque_std(*checks)
        return float(np.max(np.abs(found - expected) / np.maximum(expected, 1e-300)))

    for tolerance in TOLERANCES:
        root = _in_few_coordinates(arm, basis, tolerance)
        if change(root) < 0.5 * MOST_CHANGE:
            break
    bits = next((b for b in range(6, MOST_BITS) if change(_rounded(root, b)) < MOST_CHANGE), 24)
    return replace(arm, covariance_root=_rounded(root, bits))


def _random_states(
    arm: ArmPosterior, ranges: tuple[Array, Array], rng: np.random.Generator
) -> Array:
    """
    Draw q, dq, ddq, shape (3, STATES, n): whole turns, and twice the range of all else.

    Many velocities are near rest, where friction changes.
    """
    low, high = ranges
    middle, extent = 0.5 * (low + high), np.maximum(high - low, 1e-6)
    # a joint that rested may move one day
    extent[1:] = np.maximum(extent[1:], LEAST_MOTION * extent[1:].max(axis=1, keepdims=True))
    extent[0, ~arm.chain.prismatic] = np.pi
    shape = STATES, low.shape[1]
    states = middle[:, None] + extent[:, None] * rng.uniform(-1.0, 1.0, (3, *shape))
    states[1] *= rng.uniform(size=shape) ** 2
    return states


def _in_few_coordinates(arm: ArmPosterior, states: Array, tolerance: float) -> Array:
    """Return a root whose rows are zero but for coordinates whose torques are independent."""
    root = arm.covariance_root
    std = np.linalg.norm(root, axis=1)
    jacobian = arm.jacobian_of_coordinates(*states).reshape(-1, len(std)) * std
    triangle, pivots = qr(jacobian, mode='r', pivoting=True)
    size = np.abs(np.diagonal(triangle))
    rank = int(np.sum(size > tolerance * size[0]))
    kept, rest = pivots[:rank], pivots[rank:]
    stand_in = solve_triangular(triangle[:rank, :rank], triangle[:rank, rank:])
    scaled = root / np.where(std > 0.0, std, 1.0)[:, None]
    moved = std[kept, None] * (scaled[kept] + stand_in @ scaled[rest])
    order = np.argsort(kept)
    out = np.zeros((len(root), rank))
    out[kept[order]] = _lower(moved[order])
    return out


def _lower(root: Array) -> Array:
    """Return the lower triangular square root of root times its transpose."""
    triangle = np.asarray(qr(root.T, mode='r')[0])[: len(root)]
    out = np.zeros((len(root), len(root)))
    out[:, : len(triangle)] = triangle.T
    return out


def _rounded(root: Array, bits: int) -> Array:
    """Return numbers with mantissas of so many bits."""
    mantissa, exponent = np.frexp(root)
    return np.asarray(np.ldexp(np.round(np.ldexp(mantissa, bits)), exponent - bits))
