"""
Motions of the links of a chain, in the frame of its base (maths.md, section 10).

All that torques and energies of one joint state are computed from is in one array `work`, shape
(n + 1, `VECTORS`, 3): row 0 is of the base, row i + 1 of link i. Twists are about the origin of
the base, so that none is transformed from link to link (Featherstone, Rigid Body Dynamics
Algorithms, 2008, section 5.3).
"""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit_inlined
from lip_id_ros.rigid_body.chain import Chain, serial_value
from lip_id_ros.rigid_body.spatial import (
    add,
    add_twists,
    cross,
    cross_twists,
    load,
    load_twist,
    outwards,
    scale,
    store,
    store_twist,
    Transform,
    Twist,
    Vec3,
    ZERO,
)

ROTATION, ORIGIN, AXIS, VELOCITY, ACCELERATION, VECTORS = 0, 3, 4, 6, 8, 10
"""
Places in a row, and their number.

Columns of the rotation and origin of the link's frame; the twist of its joint at unit velocity;
twist and spatial acceleration of the link, the latter minus gravity.
"""

BASE = Transform(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), ZERO)


@jit_inlined
def placement(chain: Chain, i: int, before: Transform) -> Transform:
    """Return the frame of link i with its joint at rest, from that of the link before it."""
    r, t = chain.rotations, chain.translations
    x = outwards(before.rotation, (r[i, 0, 0], r[i, 1, 0], r[i, 2, 0]))
    y = outwards(before.rotation, (r[i, 0, 1], r[i, 1, 1], r[i, 2, 1]))
    z = outwards(before.rotation, (r[i, 0, 2], r[i, 1, 2], r[i, 2, 2]))
    shift = outwards(before.rotation, (t[i, 0], t[i, 1], t[i, 2]))
    return Transform((x, y, z), add(before.translation, shift))


@jit_inlined
def rotation_about(axis: Vec3, point: Vec3) -> Twist:
    """Return the twist of a rotation about an axis through a point."""
    return Twist(axis, cross(point, axis))


@jit_inlined
def frame_of(work: Array, row: int) -> Transform:
    """Return the frame of a link, or of the base."""
    rotation = load(work, row, 0), load(work, row, 1), load(work, row, 2)
    return Transform(rotation, load(work, row, ORIGIN))


@jit_inlined
def set_frames(work: Array, chain: Chain, q: Array) -> None:
    """Set the frames and axes of the links at reported positions, shape (n,)."""
    frame = BASE
    _store_frame(work, 0, frame)
    for i in range(len(q)):
        (x, y, z), origin = placement(chain, i, frame)
        at = serial_value(chain, i, q)
        if chain.prismatic[i]:
            store_twist(work, i + 1, AXIS, Twist(ZERO, z))
            frame = Transform((x, y, z), add(origin, scale(at, z)))
        else:
            store_twist(work, i + 1, AXIS, rotation_about(z, origin))
            c, s = np.cos(at), np.sin(at)
            turned = add(scale(c, x), scale(s, y)), add(scale(c, y), scale(-s, x)), z
            frame = Transform(turned, origin)
        _store_frame(work, i + 1, frame)


@jit_inlined
def set_velocities(work: Array, chain: Chain, dq: Array) -> None:
    """Set the twists of the links, v_i = v_(i-1) + s_i dq_i, by reported velocities (n,)."""
    v = Twist(ZERO, ZERO)
    store_twist(work, 0, VELOCITY, v)
    for i in range(len(dq)):
        v = add_twists(v, serial_value(chain, i, dq), load_twist(work, i + 1, AXIS))
        store_twist(work, i + 1, VELOCITY, v)


@jit_inlined
def set_accelerations(work: Array, chain: Chain, base: Vec3, ddq: Array) -> None:
    """
    Set the accelerations of the links by that of the base and reported ones, shape (n,).

    By twists that are set, a_i = a_(i-1) + s_i ddq_i + v_(i-1) x s_i dq_i, where v_(i-1) x v_i is
    the last term.
    """
    a, before = Twist(ZERO, base), load_twist(work, 0, VELOCITY)
    store_twist(work, 0, ACCELERATION, a)
    for i in range(len(ddq)):
        v = load_twist(work, i + 1, VELOCITY)
        a = add_twists(a, serial_value(chain, i, ddq), load_twist(work, i + 1, AXIS))
        a = add_twists(a, 1.0, cross_twists(before, v))
        store_twist(work, i + 1, ACCELERATION, a)
        before = v


@jit_inlined
def _store_frame(work: Array, row: int, frame: Transform) -> None:
    store(work, row, 0, frame.rotation[0])
    store(work, row, 1, frame.rotation[1])
    store(work, row, 2, frame.rotation[2])
    store(work, row, ORIGIN, frame.translation)
