"""Torques and energies by the recursive Newton-Euler algorithm (maths.md, sections 6 and 10)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.numba_jit import jit
from lip_id_ros.rigid_body.chain import (
    add_joint_motion,
    add_torque,
    base_acceleration,
    Chain,
    joint_component,
    joint_transform,
    link_inertia,
    LINK_PARAMETERS,
    ROTOR,
    serial_value,
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
    propagate_velocity,
    scale,
    SpatialInertia,
    SpatialMotion,
    store,
    store_transform,
    to_child,
    to_parent,
    transform_wrench,
    Vec3,
    Wrench,
    ZERO,
)

TORQUE, FORCE, UP, WORK_VECTORS = 4, 5, 6, 7
"""Places of a link's vectors in working memory, after its transform, and their number."""


class Links(NamedTuple):
    """A chain with the parameters of its links, shape (n, 11)."""

    chain: Chain
    parameters: Array


def pack_links(chain: Chain, parameters: Array) -> Array:
    """
    Lay a chain and link parameters out in one array for `rnea`.

    A query takes a quarter of a microsecond longer for every array that is passed to it.
    """
    parts = chain.rotations, chain.translations, parameters, chain.gravity, chain.couplings
    return np.concatenate([part.ravel() for part in parts])


@jit
def unpack_links(packed: Array, prismatic: IntArray) -> Links:
    """Return what `pack_links` packed, with the types of the joints beside it."""
    n = len(prismatic)
    end = n * (12 + LINK_PARAMETERS)
    rotations = packed[: 9 * n].reshape(n, 3, 3)
    translations = packed[9 * n : 12 * n].reshape(n, 3)
    parameters = packed[12 * n : end].reshape(n, LINK_PARAMETERS)
    gravity, couplings = packed[end : end + 3], packed[end + 3 :].reshape(-1, 3)
    return Links(Chain(rotations, translations, prismatic != 0, gravity, couplings), parameters)


@jit
def rnea(
    tau: Array, gravity: Array, links: Links, work: Array, q: Array, dq: Array, ddq: Array
) -> tuple[float, float]:
    """
    Return T and V; add the torques of T to `tau`, and those of V to `gravity`.

    All vectors have shape (n,); the working memory has (n, 7, 3).
    """
    kinetic = _to_tip(links, work, q, dq, ddq)
    return kinetic, _to_base(tau, gravity, links, work, ddq)


@jit
def inertial_torque(tau: Array, links: Links, work: Array, ddq: Array) -> None:
    """Add the inertial torques M(q) ddq at the position of the last `rnea`, with its memory."""
    chain, p = links
    a = d = ZERO
    n = len(ddq)
    for i in range(n):
        x = load_transform(work, i)
        d = to_child(x.rotation, add(d, cross(a, x.translation)))
        a = to_child(x.rotation, a)
        faster = serial_value(chain, i, ddq)
        if chain.prismatic[i]:
            d = add(d, (0.0, 0.0, faster))
        else:
            a = add(a, (0.0, 0.0, faster))
        body = link_inertia(p, i)
        h = body.first_moment
        store(work, i, TORQUE, add(inertia_times(body, a), cross(h, d)))
        store(work, i, FORCE, add(scale(body.mass, d), cross(a, h)))
    total = Wrench(ZERO, ZERO)
    for i in range(n - 1, -1, -1):
        total = add_wrenches(total, Wrench(load(work, i, TORQUE), load(work, i, FORCE)))
        add_torque(tau, chain, i, joint_component(total, chain.prismatic[i]))
        tau[i] += p[i, ROTOR] * ddq[i]
        total = transform_wrench(total, load_transform(work, i))


@jit
def _to_tip(links: Links, work: Array, q: Array, dq: Array, ddq: Array) -> float:
    # Sets all of `work`; returns T. The motions leave gravity out.
    chain, p = links
    v, up = ZERO, base_acceleration(chain)
    motion = SpatialMotion(ZERO, ZERO, ZERO)
    total = 0.0
    for i in range(p.shape[0]):
        x = joint_transform(chain, i, serial_value(chain, i, q))
        rate, change = serial_value(chain, i, dq), serial_value(chain, i, ddq)
        v = propagate_velocity(v, motion.angular_velocity, x)
        if chain.prismatic[i]:
            v = add(v, (0.0, 0.0, rate))
        motion = add_joint_motion(propagate_motion(motion, x), chain.prismatic[i], rate, change)
        up = to_child(x.rotation, up)
        body = link_inertia(p, i)
        total += _kinetic(body, motion.angular_velocity, v) + 0.5 * p[i, ROTOR] * dq[i] ** 2
        wrench = newton_euler(body, motion)
        store_transform(work, i, x)
        store(work, i, TORQUE, wrench.torque)
        store(work, i, FORCE, wrench.force)
        store(work, i, UP, up)
    return total


@jit
def _kinetic(body: SpatialInertia, w: Vec3, v: Vec3) -> float:
    squares = body.mass * dot(v, v) + dot(w, inertia_times(body, w))
    return 0.5 * squares + dot(v, cross(w, body.first_moment))


@jit
def _to_base(tau: Array, gravity: Array, links: Links, work: Array, ddq: Array) -> float:
    # Returns V.
    chain, p = links
    total, mass, moment = Wrench(ZERO, ZERO), 0.0, ZERO
    for i in range(p.shape[0] - 1, -1, -1):
        total = add_wrenches(total, Wrench(load(work, i, TORQUE), load(work, i, FORCE)))
        body = link_inertia(p, i)
        mass, moment = mass + body.mass, add(moment, body.first_moment)
        up = load(work, i, UP)
        weight = Wrench(cross(moment, up), scale(mass, up))
        add_torque(tau, chain, i, joint_component(total, chain.prismatic[i]))
        tau[i] += p[i, ROTOR] * ddq[i]
        add_torque(gravity, chain, i, joint_component(weight, chain.prismatic[i]))
        x = load_transform(work, i)
        total = transform_wrench(total, x)
        moment = add(to_parent(x.rotation, moment), scale(mass, x.translation))
    return dot(base_acceleration(chain), moment)
