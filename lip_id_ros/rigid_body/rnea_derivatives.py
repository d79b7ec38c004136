"""
Derivatives of torques and energies by the placements of the joints (maths.md, section 10).

A placement displaces a link and all that it carries, like a joint at rest before the link's own.
So its derivatives are those by the positions of joints (Singh, Russell and Wensing, IEEE Robotics
and Automation Letters, 2022), by sums over the links that it carries.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit, jit_inlined, jit_reading
from lip_id_ros.rigid_body.chain import (
    add_coupled_rows,
    base_acceleration,
    Chain,
    link_inertia,
)
from lip_id_ros.rigid_body.motions import (
    ACCELERATION,
    AXIS,
    frame_of,
    placement,
    rotation_about,
    set_accelerations,
    set_frames,
    set_velocities,
    VECTORS,
    VELOCITY,
)
from lip_id_ros.rigid_body.spatial import (
    add,
    add_matrices,
    add_twists,
    add_wrenches,
    cross,
    cross_twists,
    cross_wrench,
    diagonal,
    dot,
    inertia_times,
    inwards,
    load,
    load_twist,
    Mat3,
    moment_in_base,
    outer,
    outwards,
    power,
    scale,
    SpatialInertia,
    store,
    store_twist,
    trace,
    Transform,
    Twist,
    twist_into,
    Vec3,
    Wrench,
    wrench_out_of,
    ZERO,
)

DIRECTIONS = 6
"""Of a placement: three rotations about its own axes, three shifts of its origin."""

TURNING, MOVING, SLOPES = 0, 1, 3
"""Places of a torque's slopes by `Composite`, and their number."""


class Composite(NamedTuple):
    """
    A link and all that it carries, in the frame of the base.

    Of their points with mass m, position r and velocity u.
    """

    inertia: SpatialInertia
    momentum: Wrench
    flow: Mat3  # sum of m u r^T, columns
    wrench: Wrench  # that gives them their motion


NOTHING = Composite(
    SpatialInertia(0.0, ZERO, (ZERO, ZERO, ZERO)),
    Wrench(ZERO, ZERO),
    (ZERO, ZERO, ZERO),
    Wrench(ZERO, ZERO),
)


@jit_reading
def placement_derivatives(
    chain: Chain, parameters: Array, q: Array, dq: Array, ddq: Array
) -> Array:
    """
    Differentiate the torques by the placements of the joints, at contiguous joint states (N, n).

    The result has shape (N, n, n, 6), of torque i by joint j's rotations (its rotation matrix
    times a small rotation about the axes of its own frame) and translations.
    """
    count, n = q.shape
    out = np.empty((count, n, n, DIRECTIONS))
    work = np.empty((n + 1, VECTORS, 3))
    directions, slopes = np.empty((DIRECTIONS, 2, 3)), np.empty((n, SLOPES, 3))
    for t in range(count):
        set_frames(work, chain, q[t])
        set_velocities(work, chain, dq[t])
        set_accelerations(work, chain, base_acceleration(chain), ddq[t])
        carried = NOTHING
        for j in range(n - 1, -1, -1):
            carried = _with_link(carried, parameters, work, j)
            _set_slopes(slopes, j, carried, load_twist(work, j + 1, AXIS))
            _set_directions(directions, chain, work, j)
            for d in range(DIRECTIONS):
                _set_changes(
                    out[t, :, j, d], carried, slopes, work, j, load_twist(directions, d, 0)
                )
        add_coupled_rows(out[t].reshape(n, -1), chain)
    return out


@jit
def energy_derivatives(
    chain: Chain, parameters: Array, q: Array, dq: Array
) -> tuple[Array, Array]:
    """
    Differentiate both energies by the placements of the joints, at contiguous q and dq (N, n).

    The result has shape (N, n, 6): by each joint's rotations (its rotation matrix times a small
    rotation about the axes of its own frame) and translations.
    """
    count, n = q.shape
    kinetic, potential = np.empty((count, n, DIRECTIONS)), np.empty((count, n, DIRECTIONS))
    work, directions = np.empty((n + 1, VECTORS, 3)), np.empty((DIRECTIONS, 2, 3))
    up = base_acceleration(chain)
    for t in range(count):
        set_frames(work, chain, q[t])
        set_velocities(work, chain, dq[t])
        momentum, mass, moment = Wrench(ZERO, ZERO), 0.0, ZERO  # of what joint j carries
        for j in range(n - 1, -1, -1):
            frame, body = frame_of(work, j + 1), link_inertia(parameters, j)
            v = twist_into(frame, load_twist(work, j + 1, VELOCITY))
            momentum = add_wrenches(momentum, wrench_out_of(frame, inertia_times(body, v)))
            mass, moment = mass + body.mass, add(moment, moment_in_base(body, frame))
            weight = Wrench(cross(moment, up), scale(mass, up))
            _set_directions(directions, chain, work, j)
            for d in range(DIRECTIONS):
                along, before = load_twist(directions, d, 0), load_twist(work, j, VELOCITY)
                kinetic[t, j, d] = power(cross_twists(before, along), momentum)
                potential[t, j, d] = power(along, weight)
    return kinetic, potential


@jit_inlined
def _set_directions(out: Array, chain: Chain, work: Array, j: int) -> None:
    """Set the twists of a unit change of placement j, shape (6, 2, 3)."""
    before = frame_of(work, j)
    (x, y, z), origin = placement(chain, j, before)
    store_twist(out, 0, 0, rotation_about(x, origin))
    store_twist(out, 1, 0, rotation_about(y, origin))
    store_twist(out, 2, 0, rotation_about(z, origin))
    x, y, z = before.rotation
    store_twist(out, 3, 0, Twist(ZERO, x))
    store_twist(out, 4, 0, Twist(ZERO, y))
    store_twist(out, 5, 0, Twist(ZERO, z))


@jit_inlined
def _set_changes(
    out: Array, carried: Composite, slopes: Array, work: Array, j: int, along: Twist
) -> None:
    """
    Set the changes of torques, (n,), by a displacement of what joint j carries.

    Seen from there it is the base that moves: with the motion v, a of the link before, by the
    twist w = v x `along` and the acceleration a x `along` + v x w. A point with velocity u is
    accelerated by that and by 2 w x u. The joints before turn the wrench of it all too.
    """
    v, a = load_twist(work, j, VELOCITY), load_twist(work, j, ACCELERATION)
    moving = cross_twists(v, along)
    faster = add_twists(cross_twists(a, along), 1.0, cross_twists(v, moving))
    change = add_wrenches(
        _coriolis(carried, moving.angular), inertia_times(carried.inertia, faster)
    )
    change = add_wrenches(change, cross_wrench(along, carried.wrench))
    for i in range(j):
        out[i] = power(load_twist(work, i + 1, AXIS), change)
    for i in range(j, len(out)):
        out[i] = dot(load(slopes, i, TURNING), moving.angular)
        out[i] += dot(load(slopes, i, MOVING), faster.angular)
        out[i] += dot(load(slopes, i, MOVING + 1), faster.linear)


@jit_inlined
def _coriolis(carried: Composite, w: Vec3) -> Wrench:
    """Return the sum of m 2 w x u: torque 2 (tr A - A) w by the flow A, force 2 w x p."""
    flow, p = carried.flow, carried.momentum.force
    torque = add(scale(trace(flow), w), scale(-1.0, outwards(flow, w)))
    return Wrench(scale(2.0, torque), scale(2.0, cross(w, p)))


@jit_inlined
def _set_slopes(out: Array, j: int, carried: Composite, axis: Twist) -> None:
    """Set the slopes of torque j by w and the acceleration of what it carries: transposes."""
    flow, p, s = carried.flow, carried.momentum.force, axis.angular
    torque = add(scale(trace(flow), s), scale(-1.0, inwards(flow, s)))
    store(out, j, TURNING, scale(2.0, add(torque, cross(p, axis.linear))))
    inertial = inertia_times(carried.inertia, axis)
    store(out, j, MOVING, inertial.torque)
    store(out, j, MOVING + 1, inertial.force)


@jit_inlined
def _with_link(carried: Composite, parameters: Array, work: Array, j: int) -> Composite:
    body = _in_base(link_inertia(parameters, j), frame_of(work, j + 1))
    v, a = load_twist(work, j + 1, VELOCITY), load_twist(work, j + 1, ACCELERATION)
    momentum = inertia_times(body, v)
    wrench = add_wrenches(inertia_times(body, a), cross_wrench(v, momentum))
    mass, moment, inertia = carried.inertia
    whole = SpatialInertia(
        mass + body.mass,
        add(moment, body.first_moment),
        add_matrices(inertia, body.inertia),
    )
    return Composite(
        whole,
        add_wrenches(carried.momentum, momentum),
        add_matrices(carried.flow, _flow(body, v)),
        add_wrenches(carried.wrench, wrench),
    )


@jit_inlined
def _flow(body: SpatialInertia, v: Twist) -> Mat3:
    """Return the sum of m u r^T, by u = l + w x r: l h^T + w x (tr I / 2 - I)."""
    h, i, w = body.first_moment, body.inertia, v.angular
    x, y, z = add_matrices(diagonal(-0.5 * trace(i)), i)
    turning = cross(x, w), cross(y, w), cross(z, w)
    return add_matrices(outer(v.linear, h), turning)


@jit_inlined
def _in_base(body: SpatialInertia, frame: Transform) -> SpatialInertia:
    """
    Return the inertia of a link in the frame of the base.

    With its origin p and moment h there: moment g = h + m p, inertia R I R^T + (p h + p g) 1 -
    p g^T - h p^T.
    """
    rotation, p = frame
    h, g = outwards(rotation, body.first_moment), moment_in_base(body, frame)
    i, (x, y, z) = body.inertia, rotation
    turned = add_matrices(outer(outwards(rotation, i[0]), x), outer(outwards(rotation, i[1]), y))
    turned = add_matrices(turned, outer(outwards(rotation, i[2]), z))
    minus = scale(-1.0, p)
    shift = add_matrices(diagonal(dot(p, h) + dot(p, g)), outer(minus, g))
    shift = add_matrices(shift, outer(h, minus))
    return SpatialInertia(body.mass, g, add_matrices(turned, shift))
