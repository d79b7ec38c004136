"""
Derivatives of the recursive Newton-Euler algorithm by the placements (maths.md, section 10).

The change of a wrench by a link's motion is a matrix of 6 x 9, summed from the tip to the base
like composite inertias (Featherstone, Rigid Body Dynamics Algorithms, 2008, section 6.2).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit_inlined, jit_reading
from lip_id_ros.rigid_body.chain import (
    add_coupled_rows,
    add_joint_motion,
    base_acceleration,
    Chain,
    joint_row,
    joint_transform,
    link_inertia,
    serial_motion,
)
from lip_id_ros.rigid_body.spatial import (
    add,
    add_wrenches,
    cross,
    dot,
    inertia_times,
    load,
    load_transform,
    newton_euler,
    propagate_motion,
    SpatialInertia,
    SpatialMotion,
    store,
    store_transform,
    to_child,
    to_parent,
    Transform,
    transform_wrench,
    Vec3,
    Wrench,
    ZERO,
)

DIRECTIONS = 6
"""Of a placement: three rotations about its own axes, three shifts of its origin."""


class Workspace(NamedTuple):
    """
    Working memory.

    All links of a chain at one joint state. A frame changes by the directions of its placement:
    rotation in the link, translation in the parent.
    """

    transforms: Array  # (n, 4, 3)
    parent_motions: Array  # (n + 1, 3, 3), without the own joint; row 0 the base
    motions: Array  # (n + 1, 3, 3), with it
    wrenches: Array  # (n, 2, 3), of a link and all that it carries
    frame_change: Array  # (6, 6), by the directions
    motion_changes: Array  # (n, 9, 6), of motions without the own joint
    composites: Array  # (n, 6, 9), of wrenches, by these motions
    carried: Array  # (6, 9), composite of the next link by this motion
    own_changes: Array  # (n, 6, 6), of a wrench by its own placement
    base_changes: Array  # (n, 6, 6), the same in the parent's frame


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
    out = np.zeros((count, n, n, DIRECTIONS))
    q, dq, ddq = (serial_motion(chain, q), serial_motion(chain, dq), serial_motion(chain, ddq))
    work = Workspace(
        np.empty((n, 4, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n, 2, 3)),
        np.empty((6, DIRECTIONS)),
        np.empty((n, 9, DIRECTIONS)),
        np.empty((n, 6, 9)),
        np.empty((6, 9)),
        np.empty((n, 6, DIRECTIONS)),
        np.empty((n, 6, DIRECTIONS)),
    )
    for t in range(count):
        _motions_and_wrenches(work, chain, parameters, q[t], dq[t], ddq[t])
        for i in range(n - 1, -1, -1):
            _composite(work, chain, parameters, i, dq[t, i])
            _frame_change(work.frame_change, chain, i, q[t, i])
            _motion_change(work, i)
            _own_change(work, i)
            _change_at_the_joint(work, i)
        for j in range(n):
            _torque_by_own_and_carrying(out[t, j], work, chain, j, dq[t])
            _torque_by_carried(out[t, j], work, chain, j)
        add_coupled_rows(out[t].reshape(n, -1), chain)
    return out


@jit_inlined
def _motions_and_wrenches(
    work: Workspace, chain: Chain, parameters: Array, q: Array, dq: Array, ddq: Array
) -> None:
    n = len(q)
    motion = SpatialMotion(ZERO, ZERO, base_acceleration(chain))
    _store_motion(work.motions, 0, motion)
    for i in range(n):
        x = joint_transform(chain, i, q[i])
        store_transform(work.transforms, i, x)
        motion = propagate_motion(motion, x)
        _store_motion(work.parent_motions, i + 1, motion)
        motion = add_joint_motion(motion, chain.prismatic[i], dq[i], ddq[i])
        _store_motion(work.motions, i + 1, motion)
    total = Wrench(ZERO, ZERO)
    for i in range(n - 1, -1, -1):
        total = add_wrenches(
            total, newton_euler(link_inertia(parameters, i), _motion(work.motions, i + 1))
        )
        store(work.wrenches, i, 0, total.torque)
        store(work.wrenches, i, 1, total.force)
        total = transform_wrench(total, load_transform(work.transforms, i))


@jit_inlined
def _frame_change(change: Array, chain: Chain, i: int, q: float) -> None:
    change[:] = 0.0
    for d in range(3):
        change[3 + d, 3 + d] = 1.0
        unit = 1.0 * (d == 0), 1.0 * (d == 1), 1.0 * (d == 2)
        if chain.prismatic[i]:  # it slides along an axis that turns
            _put(change, 0, d, unit)
            _put(
                change,
                3,
                d,
                to_parent(joint_transform(chain, i, 0.0).rotation, cross(unit, (0.0, 0.0, q))),
            )
        else:
            c, s = np.cos(q), np.sin(q)
            _put(change, 0, d, (c * unit[0] + s * unit[1], c * unit[1] - s * unit[0], unit[2]))


@jit_inlined
def _composite(work: Workspace, chain: Chain, parameters: Array, i: int, dq: float) -> None:
    composite, w = work.composites[i], load(work.motions, i + 1, 0)
    _newton_euler_slopes(composite, link_inertia(parameters, i), w)
    if i + 1 < len(work.composites):
        x = load_transform(work.transforms, i + 1)
        for k in range(6):
            _set_row(work.carried, k, _before_the_frame(_row(work.composites[i + 1], k), w, x))
        _add_of_child(composite, work.carried, x)
    for k in range(6):
        _set_row(composite, k, _before_the_joint(_row(composite, k), chain.prismatic[i], dq))


@jit_inlined
def _newton_euler_slopes(out: Array, body: SpatialInertia, w: Vec3) -> None:
    """Set the derivatives of a wrench by `newton_euler` by the motion, shape (6, 9)."""
    h, momentum = body.first_moment, inertia_times(body, w)
    along = cross(w, h)
    out[:] = 0.0
    for k in range(3):
        unit = 1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2)
        column = inertia_times(body, unit)
        moment = cross(h, unit)
        _put(out, 0, k, add(cross(unit, momentum), cross(w, column)))
        _put(out, 3, k, add(cross(unit, along), cross(w, cross(unit, h))))
        _put(out, 0, 3 + k, column)
        _put(out, 3, 3 + k, (-moment[0], -moment[1], -moment[2]))
        _put(out, 0, 6 + k, moment)
        out[3 + k, 6 + k] = body.mass


@jit_inlined
def _add_of_child(composite: Array, carried: Array, x: Transform) -> None:
    """Add the wrenches of the child, in the columns of (6, 9), in the frame of its parent."""
    for c in range(9):
        wrench = transform_wrench(Wrench(_get(carried, 0, c), _get(carried, 3, c)), x)
        _put(composite, 0, c, add(_get(composite, 0, c), wrench.torque))
        _put(composite, 3, c, add(_get(composite, 3, c), wrench.force))


@jit_inlined
def _before_the_frame(row: SpatialMotion, w: Vec3, x: Transform) -> SpatialMotion:
    """
    Return the slope by the motion of a link from that by the motion of a frame fixed to it.

    The transpose of the derivative of `propagate_motion`, for a link with angular velocity w.
    """
    by_w = to_parent(x.rotation, row.angular_velocity)
    by_a = to_parent(x.rotation, row.angular_acceleration)
    by_d = to_parent(x.rotation, row.linear_acceleration)
    r = x.translation
    centripetal = add(cross(r, cross(by_d, w)), cross(cross(w, r), by_d))
    return SpatialMotion(add(by_w, centripetal), add(by_a, cross(r, by_d)), by_d)


@jit_inlined
def _before_the_joint(row: SpatialMotion, prismatic: bool, dq: float) -> SpatialMotion:
    """Return the slope by the motion without a link's own joint: transpose of its derivative."""
    by_w, by_a, by_d = row
    of = by_d if prismatic else by_a
    speed = 2.0 * dq if prismatic else dq
    return SpatialMotion((by_w[0] - speed * of[1], by_w[1] + speed * of[0], by_w[2]), by_a, by_d)


@jit_inlined
def _motion_change(work: Workspace, i: int) -> None:
    before, own = _motion(work.motions, i), _motion(work.parent_motions, i + 1)
    axes, w = load_transform(work.transforms, i).rotation, before.angular_velocity
    change = work.motion_changes[i]
    for d in range(DIRECTIONS):
        axis, shift = _get(work.frame_change, 0, d), _get(work.frame_change, 3, d)
        linear = add(cross(w, cross(w, shift)), cross(before.angular_acceleration, shift))
        _put(change, 0, d, cross(own.angular_velocity, axis))
        _put(change, 3, d, cross(own.angular_acceleration, axis))
        _put(change, 6, d, add(cross(own.linear_acceleration, axis), to_child(axes, linear)))


@jit_inlined
def _own_change(work: Workspace, i: int) -> None:
    composite, change, own = work.composites[i], work.motion_changes[i], work.own_changes[i]
    for k in range(6):
        _set_products(own[k], _row(composite, k), change)


@jit_inlined
def _set_products(out: Array, row: SpatialMotion, change: Array) -> None:
    """Set the products of a slope with changes of a motion, of which shifts are linear alone."""
    for d in range(3):
        turned = dot(row.angular_velocity, _get(change, 0, d))
        turned += dot(row.angular_acceleration, _get(change, 3, d))
        out[d] = turned + dot(row.linear_acceleration, _get(change, 6, d))
        out[3 + d] = dot(row.linear_acceleration, _get(change, 6, 3 + d))


@jit_inlined
def _change_at_the_joint(work: Workspace, i: int) -> None:
    # The frame of link i rotates together with the wrench on it, and its origin moves.
    x, own, at_base = load_transform(work.transforms, i), work.own_changes[i], work.base_changes[i]
    whole = Wrench(load(work.wrenches, i, 0), load(work.wrenches, i, 1))
    force = to_parent(x.rotation, whole.force)
    for d in range(DIRECTIONS):
        axis, shift = _get(work.frame_change, 0, d), _get(work.frame_change, 3, d)
        turned = Wrench(cross(axis, whole.torque), cross(axis, whole.force))
        change = add_wrenches(Wrench(_get(own, 0, d), _get(own, 3, d)), turned)
        found = add_wrenches(transform_wrench(change, x), Wrench(cross(shift, force), ZERO))
        _put(at_base, 0, d, found.torque)
        _put(at_base, 3, d, found.force)


@jit_inlined
def _torque_by_own_and_carrying(
    out: Array, work: Workspace, chain: Chain, j: int, dq: Array
) -> None:
    """Set the changes of torque j by the placements of its own link and of those before it."""
    component = joint_row(chain.prismatic[j])
    for d in range(DIRECTIONS):
        out[j, d] = work.own_changes[j, component, d]
    row = _row(work.composites[j], component)
    for i in range(j - 1, -1, -1):
        x = load_transform(work.transforms, i + 1)
        row = _before_the_frame(row, load(work.motions, i + 1, 0), x)
        row = _before_the_joint(row, chain.prismatic[i], dq[i])
        _set_products(out[i], row, work.motion_changes[i])


@jit_inlined
def _torque_by_carried(out: Array, work: Workspace, chain: Chain, j: int) -> None:
    """Set the changes of torque j by the placements of the links beyond it."""
    by_torque, by_force = ZERO, (0.0, 0.0, 1.0)
    if not chain.prismatic[j]:
        by_torque, by_force = by_force, by_torque
    for i in range(j + 1, len(out)):
        change = work.base_changes[i]
        for d in range(DIRECTIONS):
            out[i, d] = dot(by_torque, _get(change, 0, d)) + dot(by_force, _get(change, 3, d))
        x = load_transform(work.transforms, i)  # transpose of `transform_wrench`
        by_force = to_child(x.rotation, add(by_force, cross(by_torque, x.translation)))
        by_torque = to_child(x.rotation, by_torque)


@jit_inlined
def _row(array: Array, k: int) -> SpatialMotion:
    return SpatialMotion(
        (array[k, 0], array[k, 1], array[k, 2]),
        (array[k, 3], array[k, 4], array[k, 5]),
        (array[k, 6], array[k, 7], array[k, 8]),
    )


@jit_inlined
def _set_row(array: Array, k: int, row: SpatialMotion) -> None:
    array[k, 0], array[k, 1], array[k, 2] = row.angular_velocity
    array[k, 3], array[k, 4], array[k, 5] = row.angular_acceleration
    array[k, 6], array[k, 7], array[k, 8] = row.linear_acceleration


@jit_inlined
def _get(array: Array, row: int, d: int) -> Vec3:
    return array[row, d], array[row + 1, d], array[row + 2, d]


@jit_inlined
def _put(array: Array, row: int, d: int, a: Vec3) -> None:
    array[row, d], array[row + 1, d], array[row + 2, d] = a


@jit_inlined
def _motion(array: Array, i: int) -> SpatialMotion:
    return SpatialMotion(load(array, i, 0), load(array, i, 1), load(array, i, 2))


@jit_inlined
def _store_motion(array: Array, i: int, motion: SpatialMotion) -> None:
    store(array, i, 0, motion.angular_velocity)
    store(array, i, 1, motion.angular_acceleration)
    store(array, i, 2, motion.linear_acceleration)
