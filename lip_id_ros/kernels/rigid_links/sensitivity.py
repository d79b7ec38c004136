"""How torques change with the placements of the joints (docs/maths.md, section 10)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
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
    NOTHING,
    outward,
    plus,
    store,
    Triple,
)
from lip_id_ros.kernels.rigid_links.wrench import (
    body,
    both,
    row_along_joint,
    shifted,
    Wrench,
    wrench,
    wrench_change,
)

DIRECTIONS = 6
"""Of a placement: three rotations about its own axes, three shifts of its origin."""


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
    moved : array, shape (6, 6)
        How a link's frame moves in that of the link before it: its rotation, in its own frame, and
        the shift of its origin, in the frame of the link before. The last index, here and below,
        is the direction, so that all directions go together through vector instructions.
    motion : array, shape (9, 6)
        Change of a link's motion.
    changes : array, shape (n, 6, 6)
        Of what moves a link by itself.
    total : array, shape (6, 6)
        Of what moves a link and all beyond it.

    """

    places: Array
    carried: Array
    motions: Array
    wrenches: Array
    moved: Array
    motion: Array
    changes: Array
    total: Array


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
        np.empty((6, DIRECTIONS)),
        np.empty((9, DIRECTIONS)),
        np.empty((n, 6, DIRECTIONS)),
        np.empty((6, DIRECTIONS)),
    )
    for t in range(count):
        _move(links, chain, parameters, q[t], dq[t], ddq[t])
        for i in range(n):
            _displace(links.moved, chain, i, q[t, i])
            _first_change(links, i)
            _to_tip(links, chain, parameters, i, dq[t])
            _to_base(out[t, :, i], links, chain, i)
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
        total = both(total, wrench(body(parameters, i), _motion(links.motions, i + 1)))
        store(links.wrenches, i, 0, total.torque)
        store(links.wrenches, i, 1, total.force)
        total = shifted(total, load_place(links.places, i))


@compiled
def _displace(moved: Array, chain: Chain, i: int, q: float) -> None:
    moved[:] = 0.0
    for d in range(3):
        moved[3 + d, 3 + d] = 1.0
        unit = 1.0 * (d == 0), 1.0 * (d == 1), 1.0 * (d == 2)
        if chain.prismatic[i]:  # it slides along an axis that turns
            _put(moved, 0, d, unit)
            _put(moved, 3, d, inward(place(chain, i, 0.0).axes, cross(unit, (0.0, 0.0, q))))
        else:
            c, s = np.cos(q), np.sin(q)
            _put(moved, 0, d, (c * unit[0] + s * unit[1], c * unit[1] - s * unit[0], unit[2]))


@compiled
def _first_change(links: Links, i: int) -> None:
    before, own = _motion(links.motions, i), _motion(links.carried, i + 1)
    axes, w = load_place(links.places, i).axes, before.angular
    for d in range(DIRECTIONS):
        axis, shift = _get(links.moved, 0, d), _get(links.moved, 3, d)
        linear = plus(cross(w, cross(w, shift)), cross(before.angular_rate, shift))
        _put(links.motion, 0, d, cross(own.angular, axis))
        _put(links.motion, 3, d, cross(own.angular_rate, axis))
        _put(links.motion, 6, d, plus(cross(own.linear_rate, axis), outward(axes, linear)))


@compiled
def _to_tip(links: Links, chain: Chain, parameters: Array, i: int, dq: Array) -> None:
    """Set the changes of the wrenches of the links from i to the tip."""
    n, change = len(dq), links.motion
    for j in range(i, n):
        motion, own = _motion(links.motions, j + 1), body(parameters, j)
        wrenches, prismatic, speed = links.changes[j], chain.prismatic[j], dq[j]
        for d in range(DIRECTIONS):
            now = Motion(_get(change, 0, d), _get(change, 3, d), _get(change, 6, d))
            now = _with_joint_change(now, prismatic, speed)
            found = wrench_change(own, motion, now)
            _put(wrenches, 0, d, found.torque)
            _put(wrenches, 3, d, found.force)
            _put(change, 0, d, now.angular)
            _put(change, 3, d, now.angular_rate)
            _put(change, 6, d, now.linear_rate)
        if j + 1 < n:
            at = load_place(links.places, j + 1)
            for d in range(DIRECTIONS):
                now = Motion(_get(change, 0, d), _get(change, 3, d), _get(change, 6, d))
                now = _carried_change(now, motion.angular, at)
                _put(change, 0, d, now.angular)
                _put(change, 3, d, now.angular_rate)
                _put(change, 6, d, now.linear_rate)


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
def _to_base(out: Array, links: Links, chain: Chain, i: int) -> None:
    """Set the changes of all torques, shape (n, 6)."""
    total = links.total
    total[:] = 0.0
    for j in range(len(out) - 1, i, -1):
        total += links.changes[j]
        out[j] = total[row_along_joint(chain.prismatic[j])]
        _shift(total, load_place(links.places, j))
    total += links.changes[i]
    out[i] = total[row_along_joint(chain.prismatic[i])]
    _turn_and_shift(links, i)
    for j in range(i - 1, -1, -1):
        out[j] = total[row_along_joint(chain.prismatic[j])]
        _shift(total, load_place(links.places, j))


@compiled
def _shift(total: Array, at: Place) -> None:
    for d in range(DIRECTIONS):
        found = shifted(Wrench(_get(total, 0, d), _get(total, 3, d)), at)
        _put(total, 0, d, found.torque)
        _put(total, 3, d, found.force)


@compiled
def _turn_and_shift(links: Links, i: int) -> None:
    # Link i turns with what acts on it, and its origin shifts.
    at, total = load_place(links.places, i), links.total
    whole = Wrench(load(links.wrenches, i, 0), load(links.wrenches, i, 1))
    force = inward(at.axes, whole.force)
    for d in range(DIRECTIONS):
        axis, moved = _get(links.moved, 0, d), _get(links.moved, 3, d)
        turned = Wrench(cross(axis, whole.torque), cross(axis, whole.force))
        own = Wrench(_get(total, 0, d), _get(total, 3, d))
        found = both(shifted(both(own, turned), at), Wrench(cross(moved, force), NOTHING))
        _put(total, 0, d, found.torque)
        _put(total, 3, d, found.force)


@compiled
def _get(array: Array, row: int, d: int) -> Triple:
    return array[row, d], array[row + 1, d], array[row + 2, d]


@compiled
def _put(array: Array, row: int, d: int, a: Triple) -> None:
    array[row, d], array[row + 1, d], array[row + 2, d] = a


@compiled
def _motion(array: Array, i: int) -> Motion:
    return Motion(load(array, i, 0), load(array, i, 1), load(array, i, 2))


@compiled
def _store_motion(array: Array, i: int, motion: Motion) -> None:
    store(array, i, 0, motion.angular)
    store(array, i, 1, motion.angular_rate)
    store(array, i, 2, motion.linear_rate)
