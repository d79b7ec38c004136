"""How torques change with the placements of the joints (docs/maths.md, section 10)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links.chain import (
    carried,
    Chain,
    load_place,
    Motion,
    Place,
    place,
    store_place,
    upward,
    with_joint,
)
from lip_id_ros.kernels.rigid_links.triples import (
    cross,
    inward,
    load,
    outward,
    plus,
    store,
    Triple,
)
from lip_id_ros.kernels.rigid_links.wrench import (
    along_joint,
    both,
    shifted,
    Wrench,
    wrench,
    wrench_change,
)

Array = NDArray[np.float64]

DIRECTIONS = 6
"""Of a placement: three rotations about its own axes, three shifts of its origin."""

NOTHING = (0.0, 0.0, 0.0)


class Links(NamedTuple):
    """
    Working memory: all links of a chain at one joint state.

    Attributes
    ----------
    places : array, shape (n, 4, 3)
    carried, motions : arrays, shape (n + 1, 3, 3)
        Motion without and with the link's own joint; row 0 is the base, row i + 1 link i.
    wrenches : array, shape (n, 2, 3)
        What moves a link and all beyond it.
    changes : array, shape (n, 2, 3)
        Of what moves a link by itself.

    """

    places: Array
    carried: Array
    motions: Array
    wrenches: Array
    changes: Array


class Displacement(NamedTuple):
    """
    How the frame of a link moves in that of the link before it.

    Attributes
    ----------
    axis : triple
        The rotation, in the frame of the moved link.
    shift : triple
        The shift of its origin, in the frame of the link before.

    """

    axis: Triple
    shift: Triple


@compiled
def torque_sensitivity(chain: Chain, parameters: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """
    Differentiate the torques by the placements of the joints, at given parameters.

    Parameters
    ----------
    chain : Chain
    parameters : array, shape (n, 11)
    q, dq, ddq : arrays, shape (N, n)
        Joint states; contiguous.

    Returns
    -------
    array, shape (N, n, n, 6)
        Of torque i by joint j's rotations (its rotation matrix times a small rotation about the
        axes of its own frame) and translations.

    """
    count, n = q.shape
    out = np.zeros((count, n, n, DIRECTIONS))
    links = Links(
        np.empty((n, 4, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n, 2, 3)),
        np.empty((n, 2, 3)),
    )
    for t in range(count):
        _move(links, chain, parameters, q[t], dq[t], ddq[t])
        for i in range(n):
            for direction in range(DIRECTIONS):
                moved = _displacement(chain, i, direction, q[t, i])
                _to_tip(links, chain, parameters, i, moved, dq[t])
                _to_base(out[t, :, i, direction], links, chain, i, moved)
    return out


@compiled
def _move(links: Links, chain: Chain, parameters: Array, q: Array, dq: Array, ddq: Array) -> None:
    n = len(q)
    motion = Motion(NOTHING, NOTHING, upward(chain))
    _store_motion(links.motions, 0, motion)
    for i in range(n):
        at = place(chain, i, q[i])
        store_place(links.places, i, at)
        motion = carried(motion, at)
        _store_motion(links.carried, i + 1, motion)
        motion = with_joint(motion, chain.prismatic[i], dq[i], ddq[i])
        _store_motion(links.motions, i + 1, motion)
    total = Wrench(NOTHING, NOTHING)
    for i in range(n - 1, -1, -1):
        total = both(total, wrench(parameters, i, _motion(links.motions, i + 1)))
        store(links.wrenches, i, 0, total.torque)
        store(links.wrenches, i, 1, total.force)
        total = shifted(total, load_place(links.places, i))


@compiled
def _displacement(chain: Chain, i: int, direction: int, q: float) -> Displacement:
    k = direction % 3
    unit = 1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2)
    if direction >= 3:
        return Displacement(NOTHING, unit)
    if chain.prismatic[i]:  # it slides along an axis that turns
        return Displacement(unit, inward(place(chain, i, 0.0).axes, cross(unit, (0.0, 0.0, q))))
    c, s = np.cos(q), np.sin(q)
    return Displacement((c * unit[0] + s * unit[1], c * unit[1] - s * unit[0], unit[2]), NOTHING)


@compiled
def _to_tip(
    links: Links, chain: Chain, parameters: Array, i: int, moved: Displacement, dq: Array
) -> None:
    """Set the changes of the wrenches of the links from i to the tip."""
    change = _first_change(links, i, moved)
    for j in range(i, len(dq)):
        if j > i:
            at = load_place(links.places, j)
            change = _carried_change(change, load(links.motions, j, 0), at)
        change = _with_joint_change(change, chain.prismatic[j], dq[j])
        found = wrench_change(parameters, j, _motion(links.motions, j + 1), change)
        store(links.changes, j, 0, found.torque)
        store(links.changes, j, 1, found.force)


@compiled
def _first_change(links: Links, i: int, moved: Displacement) -> Motion:
    w, a = load(links.motions, i, 0), load(links.motions, i, 1)
    linear = plus(cross(w, cross(w, moved.shift)), cross(a, moved.shift))
    own = _motion(links.carried, i + 1)
    return Motion(
        cross(own.angular, moved.axis),
        cross(own.angular_rate, moved.axis),
        plus(
            cross(own.linear_rate, moved.axis),
            outward(load_place(links.places, i).axes, linear),
        ),
    )


@compiled
def _carried_change(change: Motion, w: Triple, at: Place) -> Motion:
    """Return the change of what a link has of the link before, whose angular velocity is w."""
    dw, da, dd = change
    r = at.origin
    centripetal = plus(cross(w, cross(dw, r)), cross(dw, cross(w, r)))
    return Motion(
        outward(at.axes, dw),
        outward(at.axes, da),
        outward(at.axes, plus(plus(dd, cross(da, r)), centripetal)),
    )


@compiled
def _with_joint_change(change: Motion, prismatic: bool, dq: float) -> Motion:
    dw, da, dd = change
    x, y = dw[1] * dq, -dw[0] * dq
    if prismatic:
        return Motion(dw, da, plus(dd, (2.0 * x, 2.0 * y, 0.0)))
    return Motion(dw, plus(da, (x, y, 0.0)), dd)


@compiled
def _to_base(out: Array, links: Links, chain: Chain, i: int, moved: Displacement) -> None:
    """Set the changes of all torques, shape (n,)."""
    change = Wrench(NOTHING, NOTHING)
    for j in range(len(out) - 1, i, -1):
        change = both(change, _wrench(links.changes, j))
        out[j] = along_joint(change, chain.prismatic[j])
        change = shifted(change, load_place(links.places, j))
    change = both(change, _wrench(links.changes, i))
    out[i] = along_joint(change, chain.prismatic[i])
    # Link i turns with what acts on it, and its origin shifts.
    at, whole = load_place(links.places, i), _wrench(links.wrenches, i)
    turned = Wrench(cross(moved.axis, whole.torque), cross(moved.axis, whole.force))
    lever = cross(moved.shift, inward(at.axes, whole.force))
    change = both(shifted(both(change, turned), at), Wrench(lever, NOTHING))
    for j in range(i - 1, -1, -1):
        out[j] = along_joint(change, chain.prismatic[j])
        change = shifted(change, load_place(links.places, j))


@compiled
def _wrench(array: Array, i: int) -> Wrench:
    return Wrench(load(array, i, 0), load(array, i, 1))


@compiled
def _motion(array: Array, i: int) -> Motion:
    return Motion(load(array, i, 0), load(array, i, 1), load(array, i, 2))


@compiled
def _store_motion(array: Array, i: int, motion: Motion) -> None:
    store(array, i, 0, motion.angular)
    store(array, i, 1, motion.angular_rate)
    store(array, i, 2, motion.linear_rate)
