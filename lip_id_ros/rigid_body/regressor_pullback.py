"""
Gradients by the joint state.

Of weighted sums of the regressor, and of placement derivatives. Motions and unit velocities
propagate to the tip and gradients back to the base (reverse mode: Griewank and Walther, Evaluating
Derivatives, 2008, chapter 3). A serial chain moves by C times positions that are coupled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit, jit_inlined
from lip_id_ros.rigid_body.chain import (
    add_joint_motion,
    base_acceleration,
    Chain,
    joint_transform,
    LINK_PARAMETERS,
    ROTOR,
)
from lip_id_ros.rigid_body.couplings import coupling_matrix
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS
from lip_id_ros.rigid_body.spatial import (
    add,
    cross,
    dot,
    inertia_times,
    load,
    load_transform,
    newton_euler,
    propagate_motion,
    propagate_velocity,
    scale,
    SpatialInertia,
    SpatialMotion,
    store,
    store_transform,
    to_child,
    to_parent,
    Transform,
    Vec3,
    ZERO,
)


class Workspace(NamedTuple):
    """Working memory: all links of a chain at one joint state."""

    transforms: Array  # (n, 4, 3)
    motions: Array  # (n + 1, 3, 3), row 0 the base
    arriving: Array  # (n, 3, 3), without the link's own joint
    units: Array  # (n, n, 2, 3), of link j at unit speed of joint i
    by_units: Array  # (n, 2, 3), gradients by those of one link


def regressor_pullback(chain: Chain, weights: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """
    Differentiate sums of weights times `torque_regressor` by the joint states.

    `weights`, shape (N, n, 11 n). `q`, `dq`, `ddq`: contiguous, shape (N, n). The result has shape
    (3, N, n): by q, dq and ddq.
    """
    if not chain.couplings.size:
        return np.asarray(_of_regressor(chain, weights, q, dq, ddq))
    joints = np.arange(q.shape[1])
    rotors = LINK_PARAMETERS * joints + ROTOR
    of_bodies = weights.copy()
    of_bodies[..., rotors] = 0.0
    out = _coupled(_of_regressor, chain, of_bodies, q, dq, ddq)
    out[2] += weights[:, joints, rotors]  # rotors turn with the reported positions
    return out


def placement_pullback(
    chain: Chain, parameters: Array, weights: Array, q: Array, dq: Array, ddq: Array
) -> Array:
    """
    Differentiate sums of weights times `placement_derivatives` by the joint states.

    `parameters`, shape (n, 11). `weights`, shape (N, n, 6 n). `q`, `dq`, `ddq`: contiguous, shape
    (N, n). The result has shape (3, N, n): by q, dq and ddq.
    """

    def pullback(chain: Chain, weights: Array, q: Array, dq: Array, ddq: Array) -> Array:
        return np.asarray(_of_placements(chain, parameters, weights, q, dq, ddq))

    if not chain.couplings.size:
        return pullback(chain, weights, q, dq, ddq)
    return _coupled(pullback, chain, weights, q, dq, ddq)


def _coupled(
    pullback: Callable[[Chain, Array, Array, Array, Array], Array],
    chain: Chain,
    weights: Array,
    q: Array,
    dq: Array,
    ddq: Array,
) -> Array:
    """Return by reported motions what a pullback of the serial chain gives by those of joints."""
    matrix = coupling_matrix(chain)
    of_joints = np.ascontiguousarray(np.einsum('ji,tic->tjc', matrix, weights))
    states = [np.ascontiguousarray(x @ matrix.T) for x in (q, dq, ddq)]
    return np.asarray(pullback(chain, of_joints, states[0], states[1], states[2]) @ matrix)


@jit
def _of_regressor(chain: Chain, weights: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """Return `regressor_pullback` of a serial chain."""
    count, n = q.shape
    out = np.zeros((3, count, n))
    work = Workspace(
        np.empty((n, 4, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n, 3, 3)),
        np.empty((n, n, 2, 3)),
        np.empty((n, 2, 3)),
    )
    for t in range(count):
        _to_tip(work, chain, q[t], dq[t], ddq[t])
        by_motion = SpatialMotion(ZERO, ZERO, ZERO)
        work.by_units[:] = 0.0
        for j in range(n - 1, -1, -1):
            of_body = weights[t, :, LINK_PARAMETERS * j : LINK_PARAMETERS * (j + 1)]
            by_motion = _add_of_body(work, of_body, j, by_motion)
            out[2, t, j] += of_body[j, ROTOR]
            by_motion, speed, change = _before_the_joint(
                by_motion, load(work.arriving, j, 0), chain.prismatic[j], dq[t, j]
            )
            out[1, t, j] += speed
            out[2, t, j] += change
            out[0, t, j] += _by_position(work, chain, j, by_motion)
            by_motion = _before_the_frame(work, j, by_motion)
    return out


@jit_inlined
def _to_tip(work: Workspace, chain: Chain, q: Array, dq: Array, ddq: Array) -> None:
    motion = SpatialMotion(ZERO, ZERO, base_acceleration(chain))
    _store_motion(work.motions, 0, motion)
    for j in range(len(q)):
        x = joint_transform(chain, j, q[j])
        store_transform(work.transforms, j, x)
        motion = propagate_motion(motion, x)
        _store_motion(work.arriving, j, motion)
        motion = add_joint_motion(motion, chain.prismatic[j], dq[j], ddq[j])
        _store_motion(work.motions, j + 1, motion)
        for i in range(j):
            angular = load(work.units[j - 1], i, 0)
            linear = propagate_velocity(load(work.units[j - 1], i, 1), angular, x)
            store(work.units[j], i, 0, to_child(x.rotation, angular))
            store(work.units[j], i, 1, linear)
        axis = (0.0, 0.0, 1.0)
        store(work.units[j], j, 0, ZERO if chain.prismatic[j] else axis)
        store(work.units[j], j, 1, axis if chain.prismatic[j] else ZERO)


@jit_inlined
def _add_of_body(
    work: Workspace, weights: Array, j: int, by_motion: SpatialMotion
) -> SpatialMotion:
    """Add the gradients of one body's power by its motion and by the unit velocities."""
    motion = _motion(work.motions, j + 1)
    by_w, by_a, by_d = by_motion
    for i in range(j + 1):
        body = _body(weights[i])
        angular, linear = load(work.units[j], i, 0), load(work.units[j], i, 1)
        wrench = newton_euler(body, motion)
        store(work.by_units, i, 0, add(load(work.by_units, i, 0), wrench.torque))
        store(work.by_units, i, 1, add(load(work.by_units, i, 1), wrench.force))
        h, w = body.first_moment, motion.angular_velocity
        by_d = add(by_d, add(scale(body.mass, linear), cross(angular, h)))
        by_a = add(by_a, add(inertia_times(body, angular), cross(h, linear)))
        by_w = add(by_w, cross(inertia_times(body, w), angular))
        by_w = add(by_w, inertia_times(body, cross(angular, w)))
        by_w = add(by_w, _by_centripetal(linear, w, h))
    return SpatialMotion(by_w, by_a, by_d)


@jit_inlined
def _before_the_joint(
    by_motion: SpatialMotion, w: Vec3, prismatic: bool, dq: float
) -> tuple[SpatialMotion, float, float]:
    """Return the gradient by the arriving motion, and those by speed and acceleration."""
    by_w, by_a, by_d = by_motion
    if prismatic:
        by_w = add(by_w, (-2.0 * dq * by_d[1], 2.0 * dq * by_d[0], 0.0))
        speed = 2.0 * (by_d[0] * w[1] - by_d[1] * w[0])
        return SpatialMotion(by_w, by_a, by_d), speed, by_d[2]
    speed = by_w[2] + by_a[0] * w[1] - by_a[1] * w[0]
    by_w = add(by_w, (-dq * by_a[1], dq * by_a[0], 0.0))
    return SpatialMotion(by_w, by_a, by_d), speed, by_a[2]


@jit_inlined
def _by_position(work: Workspace, chain: Chain, j: int, by_motion: SpatialMotion) -> float:
    if chain.prismatic[j]:
        return _by_shift(work, j, by_motion)
    arriving = _motion(work.arriving, j)
    total = _by_turn(by_motion.angular_velocity, arriving.angular_velocity)
    total += _by_turn(by_motion.angular_acceleration, arriving.angular_acceleration)
    total += _by_turn(by_motion.linear_acceleration, arriving.linear_acceleration)
    for i in range(j):
        for part in range(2):
            total += _by_turn(load(work.by_units, i, part), load(work.units[j], i, part))
    return total


@jit_inlined
def _by_turn(by: Vec3, vector: Vec3) -> float:
    """Return the gradient by the turn of the frame, about z, in which a vector is given."""
    return by[0] * vector[1] - by[1] * vector[0]


@jit_inlined
def _by_shift(work: Workspace, j: int, by_motion: SpatialMotion) -> float:
    x, parent = load_transform(work.transforms, j), _motion(work.motions, j)
    axis, w = x.rotation[2], parent.angular_velocity
    moved = add(cross(parent.angular_acceleration, axis), cross(w, cross(w, axis)))
    total = dot(to_parent(x.rotation, by_motion.linear_acceleration), moved)
    for i in range(j):
        by_linear = to_parent(x.rotation, load(work.by_units, i, 1))
        total += dot(by_linear, cross(load(work.units[j - 1], i, 0), axis))
    return total


@jit_inlined
def _before_the_frame(work: Workspace, j: int, by_motion: SpatialMotion) -> SpatialMotion:
    """Return the gradient by the motion of the parent; those by unit velocities in place."""
    x: Transform = load_transform(work.transforms, j)
    by_w, by_a, by_d = (
        to_parent(x.rotation, by_motion.angular_velocity),
        to_parent(x.rotation, by_motion.angular_acceleration),
        to_parent(x.rotation, by_motion.linear_acceleration),
    )
    w = load(work.motions, j, 0)
    for i in range(j):
        by_linear = to_parent(x.rotation, load(work.by_units, i, 1))
        by_angular = to_parent(x.rotation, load(work.by_units, i, 0))
        store(work.by_units, i, 0, add(by_angular, cross(x.translation, by_linear)))
        store(work.by_units, i, 1, by_linear)
    return SpatialMotion(
        add(by_w, _by_centripetal(by_d, w, x.translation)),
        add(by_a, cross(x.translation, by_d)),
        by_d,
    )


@jit_inlined
def _by_centripetal(by: Vec3, w: Vec3, r: Vec3) -> Vec3:
    """Differentiate by . (w x (w x r)) by w."""
    out = add(scale(dot(w, r), by), scale(dot(by, w), r))
    return add(out, scale(-2.0 * dot(by, r), w))


@jit_inlined
def _body(p: Array) -> SpatialInertia:
    inertia = (p[4], p[5], p[6]), (p[5], p[7], p[8]), (p[6], p[8], p[9])
    return SpatialInertia(p[0], (p[1], p[2], p[3]), inertia)


@jit_inlined
def _store_motion(array: Array, i: int, motion: SpatialMotion) -> None:
    store(array, i, 0, motion.angular_velocity)
    store(array, i, 1, motion.angular_acceleration)
    store(array, i, 2, motion.linear_acceleration)


@jit_inlined
def _motion(array: Array, i: int) -> SpatialMotion:
    return SpatialMotion(load(array, i, 0), load(array, i, 1), load(array, i, 2))


STEP = 1e-4
"""Largest rotation [rad] and translation [m] of the displaced chains."""


@jit
def _of_placements(
    chain: Chain, parameters: Array, weights: Array, q: Array, dq: Array, ddq: Array
) -> Array:
    """Return `placement_pullback` of a serial chain."""
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
                gradient = _of_regressor(there, of_torque, *state)
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
