"""
Derivatives of the energies of links by the placements of the joints (maths.md, section 10).

A placement displaces a link and all that it carries: momentum times change of velocity, and
weight.
"""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit
from lip_id_ros.rigid_body.chain import (
    base_acceleration,
    Chain,
    joint_transform,
    link_inertia,
    serial_motion,
)
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS
from lip_id_ros.rigid_body.spatial import (
    add,
    add_wrenches,
    cross,
    inertia_times,
    load,
    load_transform,
    propagate_velocity,
    scale,
    SpatialInertia,
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

W, V, UP, VECTORS = 4, 5, 6, 7
"""Vectors of a link in working memory: angular and linear velocity, and up."""


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
    kinetic, potential = np.zeros((count, n, DIRECTIONS)), np.zeros((count, n, DIRECTIONS))
    work = np.zeros((n + 1, VECTORS, 3))
    q, dq = serial_motion(chain, q), serial_motion(chain, dq)
    for t in range(count):
        _to_tip(work, chain, q[t], dq[t])
        _to_base(kinetic[t], potential[t], work, chain, parameters, q[t])
    return kinetic, potential


@jit
def _to_tip(work: Array, chain: Chain, q: Array, dq: Array) -> None:
    # Row 0 is the base, row i + 1 link i.
    w = v = ZERO
    up = base_acceleration(chain)
    store(work, 0, W, w)
    store(work, 0, V, v)
    store(work, 0, UP, up)
    for i in range(len(q)):
        x = joint_transform(chain, i, q[i])
        v = propagate_velocity(v, w, x)
        w = to_child(x.rotation, w)
        if chain.prismatic[i]:
            v = add(v, (0.0, 0.0, dq[i]))
        else:
            w = add(w, (0.0, 0.0, dq[i]))
        up = to_child(x.rotation, up)
        store_transform(work, i + 1, x)
        store(work, i + 1, W, w)
        store(work, i + 1, V, v)
        store(work, i + 1, UP, up)


@jit
def _momentum(body: SpatialInertia, w: Vec3, v: Vec3) -> Wrench:
    angular = add(inertia_times(body, w), cross(body.first_moment, v))
    return Wrench(angular, add(scale(body.mass, v), cross(w, body.first_moment)))


@jit
def _to_base(
    kinetic: Array, potential: Array, work: Array, chain: Chain, p: Array, q: Array
) -> None:
    momentum, mass, moment = Wrench(ZERO, ZERO), 0.0, ZERO
    for i in range(len(q) - 1, -1, -1):
        body = link_inertia(p, i)
        own = _momentum(body, load(work, i + 1, W), load(work, i + 1, V))
        momentum = add_wrenches(momentum, own)
        mass, moment = mass + body.mass, add(moment, body.first_moment)
        # The frame of the placement: that of the link before its joint moves.
        placement = joint_transform(chain, i, 0.0)
        if chain.prismatic[i]:
            joint = Transform(
                ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (0.0, 0.0, q[i])
            )
        else:
            c, s = np.cos(q[i]), np.sin(q[i])
            joint = Transform(((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)), ZERO)
        carried = transform_wrench(momentum, joint)
        first = add(to_parent(joint.rotation, moment), scale(mass, joint.translation))
        _displace(kinetic[i], potential[i], work, i, placement, carried, mass, first)
        x = load_transform(work, i + 1)
        momentum = transform_wrench(momentum, x)
        moment = add(to_parent(x.rotation, moment), scale(mass, x.translation))


@jit
def _displace(
    kinetic: Array,
    potential: Array,
    work: Array,
    i: int,
    placement: Transform,
    momentum: Wrench,
    mass: float,
    moment: Vec3,
) -> None:
    # Row i of `work` is the parent of link i.
    w, v, up = load(work, i, W), load(work, i, V), load(work, i, UP)
    own_w = to_child(placement.rotation, w)
    own_v = propagate_velocity(v, w, placement)
    # w x d . L for a rotation d, and likewise v: d . (L x w + p x v)
    turned = add(cross(momentum.torque, own_w), cross(momentum.force, own_v))
    shifted = cross(to_parent(placement.rotation, momentum.force), w)
    tilted = cross(moment, to_child(placement.rotation, up))
    kinetic[0], kinetic[1], kinetic[2] = turned
    kinetic[3], kinetic[4], kinetic[5] = shifted
    potential[0], potential[1], potential[2] = tilted
    potential[3], potential[4], potential[5] = scale(mass, up)
