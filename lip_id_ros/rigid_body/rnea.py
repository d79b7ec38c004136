"""Torques and energies by the recursive Newton-Euler algorithm (maths.md, sections 6 and 10)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.numba_jit import jit_inlined
from lip_id_ros.rigid_body.chain import (
    add_torque,
    base_acceleration,
    Chain,
    link_inertia,
    LINK_PARAMETERS,
    ROTOR,
    serial_value,
)
from lip_id_ros.rigid_body.motions import (
    ACCELERATION,
    AXIS,
    frame_of,
    set_accelerations,
    set_frames,
    set_velocities,
    VELOCITY,
)
from lip_id_ros.rigid_body.spatial import (
    add,
    add_twists,
    add_wrenches,
    cross,
    cross_wrench,
    dot,
    inertia_times,
    load_twist,
    moment_in_base,
    power,
    scale,
    store_twist,
    Twist,
    twist_into,
    Wrench,
    wrench_out_of,
    ZERO,
)


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


@jit_inlined
def unpack_links(packed: Array, prismatic: IntArray) -> Links:
    """Return what `pack_links` packed, with the types of the joints beside it."""
    n = len(prismatic)
    end = n * (12 + LINK_PARAMETERS)
    rotations = packed[: 9 * n].reshape(n, 3, 3)
    translations = packed[9 * n : 12 * n].reshape(n, 3)
    parameters = packed[12 * n : end].reshape(n, LINK_PARAMETERS)
    gravity, couplings = packed[end : end + 3], packed[end + 3 :].reshape(-1, 3)
    return Links(Chain(rotations, translations, prismatic != 0, gravity, couplings), parameters)


@jit_inlined
def rnea(
    tau: Array, gravity: Array, links: Links, work: Array, q: Array, dq: Array, ddq: Array
) -> tuple[float, float]:
    """
    Return T and V; add the torques of T to `tau`, and those of V to `gravity`.

    All vectors have shape (n,); `work` is that of `motions`.
    """
    set_frames(work, links.chain, q)
    return moving_torque(tau, links, work, dq, ddq), weight_torque(gravity, links, work)


@jit_inlined
def moving_torque(tau: Array, links: Links, work: Array, dq: Array, ddq: Array) -> float:
    """
    Return T, and add its torques to `tau`, without gravity, in frames that are set.

    A link with the spatial inertia I needs the wrench I a + v x* I v (Featherstone, 2008, section
    5.3), which the joints before it carry.
    """
    chain, p = links
    set_velocities(work, chain, dq)
    set_accelerations(work, chain, ZERO, ddq)
    total, kinetic = Wrench(ZERO, ZERO), 0.0
    for i in range(len(tau) - 1, -1, -1):
        frame, body = frame_of(work, i + 1), link_inertia(p, i)
        v = twist_into(frame, load_twist(work, i + 1, VELOCITY))
        a = twist_into(frame, load_twist(work, i + 1, ACCELERATION))
        momentum = inertia_times(body, v)
        wrench = add_wrenches(inertia_times(body, a), cross_wrench(v, momentum))
        total = add_wrenches(total, wrench_out_of(frame, wrench))
        add_torque(tau, chain, i, power(load_twist(work, i + 1, AXIS), total))
        tau[i] += p[i, ROTOR] * ddq[i]  # a rotor turns with its drive
        kinetic += 0.5 * (power(v, momentum) + p[i, ROTOR] * dq[i] ** 2)
    return kinetic


@jit_inlined
def inertial_torque(tau: Array, links: Links, work: Array, ddq: Array) -> None:
    """Add the inertial torques M(q) ddq, of an arm at rest, in frames that are set."""
    chain, p = links
    a, total = Twist(ZERO, ZERO), Wrench(ZERO, ZERO)
    for i in range(len(tau)):
        a = add_twists(a, serial_value(chain, i, ddq), load_twist(work, i + 1, AXIS))
        store_twist(work, i + 1, ACCELERATION, a)
    for i in range(len(tau) - 1, -1, -1):
        frame = frame_of(work, i + 1)
        a = twist_into(frame, load_twist(work, i + 1, ACCELERATION))
        total = add_wrenches(total, wrench_out_of(frame, inertia_times(link_inertia(p, i), a)))
        add_torque(tau, chain, i, power(load_twist(work, i + 1, AXIS), total))
        tau[i] += p[i, ROTOR] * ddq[i]  # a rotor turns with its drive


@jit_inlined
def weight_torque(gravity: Array, links: Links, work: Array) -> float:
    """Return V, and add its torques to `gravity`, in frames that are set."""
    chain, p = links
    up, mass, moment = base_acceleration(chain), 0.0, ZERO
    for i in range(len(gravity) - 1, -1, -1):
        frame, body = frame_of(work, i + 1), link_inertia(p, i)
        mass, moment = mass + body.mass, add(moment, moment_in_base(body, frame))
        weight = Wrench(cross(moment, up), scale(mass, up))
        add_torque(gravity, chain, i, power(load_twist(work, i + 1, AXIS), weight))
    return dot(up, moment)
