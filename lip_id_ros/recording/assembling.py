"""Parts of a recording into samples of all joints: one clock, one order, one set of joints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.recording.mapping import Reason
from lip_id_ros.recording.parts import Part
from lip_id_ros.recording.timing import arrange, GAP_STEPS, header_stamps_usable

HEADER, RECEIVE = 'header', 'receive'


class Motion(NamedTuple):
    """Samples in the order of time: stamps [ns], and position, velocity, effort by column."""

    stamps_ns: IntArray
    position: Array
    velocity: Array
    effort: Array


def clock_of(parts: Sequence[Part], wanted: str) -> str:
    """Return the clock that is wanted, else headers where those of all parts tell the time."""
    if wanted in (HEADER, RECEIVE):
        return wanted
    usable = all(header_stamps_usable(part.header_ns) for part in parts)
    return HEADER if usable else RECEIVE


def in_order(part: Part, clock: str, counts: Counter[str], notes: dict[str, None]) -> Motion:
    """
    Return the usable messages of a part in the order of time; count the others.

    The arrays of the part are used up: they are put in order where they are, one after the other.

    """
    keep = _complete(part, counts)
    whole = keep.all()
    stamps = part.header_ns if clock == HEADER else part.receive_ns
    timeline = arrange(stamps if whole else stamps[keep])
    rows = timeline.rows if whole else np.flatnonzero(keep)[timeline.rows]
    counts.update(timeline.dropped)
    if timeline.late:
        notes[f'{timeline.late} messages came late and were put where they belong'] = None
    if timeline.restarts:
        notes[
            f'the clock went back for good {timeline.restarts} times: what follows was put an '
            'hour later'
        ] = None
    values = (_picked(array, rows) for array in part[3:])
    return Motion(timeline.start_ns + timeline.t_ns, *values)


def covering(parts: Sequence[Part], joints: Sequence[str]) -> list[tuple[Part, list[str]]]:
    """
    Choose parts that have all joints together, and what to take from each.

    The first with all joints, where there is one; else, again and again, the one with most of
    those still missing. Empty where they cannot be had.

    """
    missing = list(joints)
    chosen: list[tuple[Part, list[str]]] = []
    while missing:
        best = max(parts, key=lambda part: len(set(part.joints) & set(missing)), default=None)
        taken = [] if best is None else [joint for joint in missing if joint in best.joints]
        if best is None or not taken:
            return []
        chosen.append((best, taken))
        missing = [joint for joint in missing if joint not in taken]
    return chosen


def joined(
    chosen: Sequence[tuple[Part, list[str]]],
    joints: Sequence[str],
    clock: str,
    counts: Counter[str],
    notes: dict[str, None],
) -> Motion:
    """Return the samples of all joints, in their order, of parts that `covering` chose."""
    if not chosen:
        nothing = np.empty((0, len(joints)))
        return Motion(np.empty(0, np.int64), nothing, nothing, nothing)
    if len(chosen) == 1:  # it has all joints in their order
        return in_order(chosen[0][0], clock, counts, notes)
    motions = []
    for part, taken in chosen:
        motion = in_order(part, clock, counts, notes)
        columns = [part.joints.index(joint) for joint in taken]
        motions.append(Motion(motion.stamps_ns, *(values[:, columns] for values in motion[1:])))
    names = [joint for _, taken in chosen for joint in taken]
    order = [names.index(joint) for joint in joints]
    motion = merged(motions, counts)
    return Motion(motion.stamps_ns, *(values[:, order] for values in motion[1:]))


def merged(motions: Sequence[Motion], counts: Counter[str]) -> Motion:
    """
    Bring several motions to the stamps of the one with the fewest, and join their columns.

    Between two samples no further apart than five median steps the others are interpolated
    linearly; at an equal stamp they are taken as they are. Where there are no two such samples,
    the message is dropped and counted.

    """
    slowest = min(motions, key=lambda motion: motion.stamps_ns.size)
    stamps = slowest.stamps_ns
    placed = [_placed(motion.stamps_ns, stamps) for motion in motions]
    keep = np.logical_and.reduce([known for _, _, known in placed])
    counts[Reason.OTHER_JOINTS_AWAY] += int((~keep).sum())
    columns = [
        np.hstack(
            [
                _between(getattr(motion, name), before[keep], weight[keep])
                for motion, (before, weight, _) in zip(motions, placed, strict=True)
            ]
        )
        for name in ('position', 'velocity', 'effort')
    ]
    return Motion(stamps[keep], *columns)


def _complete(part: Part, counts: Counter[str]) -> BoolArray:
    """Mark messages that have velocity and effort, unless none has."""
    keep = np.ones(part.header_ns.size, bool)
    absent = ((part.velocity, Reason.NO_VELOCITY), (part.effort, Reason.NO_EFFORT))
    for values, reason in absent:
        empty = np.isnan(values[:, 0])
        if not empty.all():
            counts[reason] += int((keep & empty).sum())
            keep &= ~empty
    return keep


def _picked(array: Array, rows: IndexArray) -> Array:
    """Move rows to the front, in their order, and return them."""
    if rows.size != len(array) or (np.diff(rows) != 1).any():
        array[: rows.size] = array[rows]
    return array[: rows.size]


def _placed(given: IntArray, wanted: IntArray) -> tuple[IndexArray, Array, BoolArray]:
    """Return for each wanted stamp the sample before, the share of the next, and if both are."""
    if given.size < 2:
        before = np.zeros(wanted.size, np.intp)
        known = wanted == given[0] if given.size else np.zeros(wanted.size, bool)
        return before, np.zeros(wanted.size), known
    before = np.searchsorted(given, wanted, side='right') - 1
    exact = given[np.maximum(before, 0)] == wanted
    start = np.clip(before, 0, given.size - 2)
    steps = np.diff(given)
    near = steps[start] <= GAP_STEPS * float(np.median(steps))
    inside = (before >= 0) & (before < given.size - 1)
    weight = (wanted - given[start]) / steps[start]
    weight[exact & (before < given.size - 1)] = 0.0
    return start, np.clip(weight, 0.0, 1.0), exact | (inside & near)


def _between(values: Array, before: IndexArray, weight: Array) -> Array:
    if len(values) < 2:
        return values[before]
    first, second = values[before], values[before + 1]
    mixed: Array = first + weight[:, np.newaxis] * (second - first)
    at_second = weight == 1.0
    mixed[at_second] = second[at_second]
    return mixed
