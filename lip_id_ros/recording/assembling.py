"""Parts of a recording into samples of all joints: one clock, one order, one set of joints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.recording.joint_samples import gathered, JointSamples, Reason, SIGNALS
from lip_id_ros.recording.sample_collector import Part, SampleCollector
from lip_id_ros.recording.spill import column_array, release, row_blocks
from lip_id_ros.recording.timing import (
    arrange,
    GAP_STEPS,
    is_one_clock,
    jumps_between_clocks,
    SECOND,
    seconds,
    stamps_advance,
)

HEADER, RECEIVE = 'header', 'receive'

_SHOWN_NAMES = 3


class _Source(NamedTuple):
    """What is taken of a part: joints by column, and rows in the order of time."""

    part: Part
    columns: IndexArray
    stamps_ns: IntArray
    rows: IndexArray


def assembled(topics: Sequence[SampleCollector], wanted_clock: str) -> JointSamples:
    """
    Return the samples of all joints that the topics of a recording have together.

    Parameters
    ----------
    topics : sequence of SampleCollector
        Each used up.
    wanted_clock : str
        'header', 'receive', or 'auto': headers if those of all parts are times of one clock.

    """
    parts = [part for topic in topics for part in topic.parts()]
    counts = sum((topic.counts for topic in topics), Counter[str]())
    notes = {note: None for topic in topics for note in topic.notes}
    joints = next((topic.joints for topic in topics if topic.joints), ())
    parts = [of_one_publisher(part, counts, notes) for part in parts]
    chosen = covering(parts, joints)
    for part in parts:
        if not any(part is one for one, _ in chosen):
            has_all = set(part.joints) >= set(joints)
            reason = Reason.OTHER_PUBLISHER if has_all else Reason.MISSING_JOINT
            counts[reason] += part.header_ns.size
    clock = clock_of([part for part, _ in chosen], wanted_clock, notes)
    if len(chosen) > 1:
        notes[f'joints of {len(chosen)} publishers were merged in time'] = None
    sources = [_source(part, taken, clock, counts, notes) for part, taken in chosen]
    names = [joint for _, taken in chosen for joint in taken]
    order = [names.index(joint) for joint in joints] if names else []
    stamps, values = merged(sources, order, counts)
    start_ns = int(stamps[0]) if stamps.size else 0
    return JointSamples(
        t=seconds(stamps - start_ns),
        **dict(zip(SIGNALS, values, strict=True)),
        joint_names=joints,
        start_s=start_ns / SECOND,
        counts={str(reason): count for reason, count in counts.items() if count},
        source=', '.join(dict.fromkeys(topic.source for topic in topics)),
        topic=', '.join(dict.fromkeys(topic.topic for topic in topics)),
        seen_joints=tuple(dict.fromkeys(name for topic in topics for name in topic.seen)),
        clock=clock,
        notes=tuple(notes),
    )


def of_one_publisher(part: Part, counts: Counter[str], notes: dict[str, None]) -> Part:
    """
    Return the messages of one publisher, where several publish the same joints.

    Messages with the same joints that differ in their frame are of one publisher if their header
    stamps are those of one clock. Of several publishers the one is taken that has effort and
    velocity, and then the one with the most messages; the others are counted.

    """
    if len(part.publishers) < 2 or not _are_apart(part):
        return part
    sizes = np.bincount(part.publisher, minlength=len(part.publishers))
    filled = [_filled(part.effort), _filled(part.velocity)]

    def worth(number: int) -> tuple[bool, bool, int]:
        own = part.publisher == number
        has_effort, has_velocity = (bool((own & has).any()) for has in filled)
        return has_effort, has_velocity, int(sizes[number])

    best = max(range(len(part.publishers)), key=worth)
    counts[Reason.OTHER_PUBLISHER] += int(sizes.sum() - sizes[best])
    notes[
        f'{len(sizes)} publishers have the same joints: the one with {sizes[best]} messages'
        f'{_described(part, best)} was taken'
    ] = None
    rows = np.flatnonzero(part.publisher == best)
    return part._replace(
        header_ns=part.header_ns[rows],
        receive_ns=part.receive_ns[rows],
        publisher=part.publisher[rows],
        position=gathered(part.position, rows),
        velocity=gathered(part.velocity, rows),
        effort=gathered(part.effort, rows),
    )


def _are_apart(part: Part) -> bool:
    """Whether publishers take turns and cannot be one."""
    if (np.diff(part.publisher) != 0).sum() < len(part.publishers):
        return False  # one after the other
    if len({names for names, _ in part.publishers}) > 1:
        return True
    return not is_one_clock(part.header_ns)


def _described(part: Part, number: int) -> str:
    names, frame = part.publishers[number]
    extra = sorted(names - set(part.joints))
    if extra:
        more = ', ...' if len(extra) > _SHOWN_NAMES else ''
        return f' (it also has {", ".join(extra[:_SHOWN_NAMES])}{more})'
    if len({frame for _, frame in part.publishers}) > 1:
        return f' (its frame is {frame!r})'
    return ' (it has no other joints)'


def clock_of(parts: Sequence[Part], wanted: str, notes: dict[str, None]) -> str:
    """Return the clock that is wanted, else headers if those of all parts are of one clock."""
    if wanted in (HEADER, RECEIVE):
        return wanted
    if not all(stamps_advance(part.header_ns) for part in parts):
        return RECEIVE
    is_torn = any(jumps_between_clocks(part.header_ns) for part in parts)
    if is_torn and all(_is_of_one_clock(part.receive_ns) for part in parts):
        notes[
            'the header stamps are those of several clocks: the times of reception were taken'
        ] = None
        return RECEIVE
    return HEADER


def _is_of_one_clock(stamps_ns: IntArray) -> bool:
    return stamps_advance(stamps_ns) and not jumps_between_clocks(stamps_ns)


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


def merged(
    sources: Sequence[_Source], order: Sequence[int], counts: Counter[str]
) -> tuple[IntArray, list[Array]]:
    """
    Bring several sources to the stamps of the one with the fewest, and join their columns.

    Between two samples no further apart than five median steps the others are interpolated
    linearly; at an equal stamp they are taken as they are. Where there are no two such samples,
    the message is dropped and counted.

    Parameters
    ----------
    sources : sequence of _Source
    order : sequence of int
        Where in the joined columns each joint is.
    counts : Counter

    Returns
    -------
    stamps_ns : ndarray of int, shape (N,)
    values : list of three ndarray, shape (N, n)
        Position, velocity, effort.

    """
    if not sources:
        return np.empty(0, np.int64), [np.empty((0, len(order)))] * 3
    stamps = min((source.stamps_ns for source in sources), key=len)
    if len(sources) == 1:
        return stamps, [_taken(sources[0], name) for name in SIGNALS]
    placed = [_placed(source.stamps_ns, stamps) for source in sources]
    keep = np.logical_and.reduce([known for _, _, known in placed])
    counts[Reason.OTHER_JOINTS_AWAY] += int((~keep).sum())
    results = [column_array(int(keep.sum()), len(order)) for _ in SIGNALS]
    for name, result in zip(SIGNALS, results, strict=True):
        for block in row_blocks(len(result)):
            kept = np.flatnonzero(keep)[block]
            columns = [
                _between(source, name, before[kept], weight[kept])
                for source, (before, weight, _) in zip(sources, placed, strict=True)
            ]
            result[block] = np.hstack(columns)[:, order]
            release(result, *(getattr(source.part, name) for source in sources))
    return stamps[keep], results


def _source(
    part: Part,
    taken: Sequence[str],
    clock: str,
    counts: Counter[str],
    notes: dict[str, None],
) -> _Source:
    """Put the usable messages of a part in the order of time; count the others."""
    keep = _complete(part, counts)
    stamps = part.header_ns if clock == HEADER else part.receive_ns
    timeline = arrange(stamps if keep.all() else stamps[keep])
    counts.update(timeline.dropped)
    notes.update(dict.fromkeys(timeline.notes()))
    rows = timeline.rows if keep.all() else np.flatnonzero(keep)[timeline.rows]
    columns = np.array([part.joints.index(joint) for joint in taken])
    return _Source(part, columns, timeline.start_ns + timeline.t_ns, rows)


def _filled(values: Array) -> BoolArray:
    """Mark rows that are not empty."""
    filled = np.empty(len(values), bool)
    for block in row_blocks(len(values)):
        filled[block] = ~np.isnan(values[block, 0])
        release(values)
    return filled


def _complete(part: Part, counts: Counter[str]) -> BoolArray:
    """Mark messages that have velocity and effort, unless none has; count the others once."""
    keep = np.ones(part.header_ns.size, bool)
    absent = ((part.velocity, Reason.NO_VELOCITY), (part.effort, Reason.NO_EFFORT))
    for values, reason in absent:
        filled = _filled(values)
        if filled.any():
            counts[reason] += int((keep & ~filled).sum())
            keep &= filled
    return keep


def _taken(source: _Source, name: str) -> Array:
    return gathered(getattr(source.part, name), source.rows, source.columns)


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


def _between(source: _Source, name: str, before: IndexArray, weight: Array) -> Array:
    values, rows = getattr(source.part, name), source.rows
    first: Array = values[rows[before]][:, source.columns]
    if rows.size < 2:
        return first
    second = values[rows[before + 1]][:, source.columns]
    mixed: Array = first + weight[:, np.newaxis] * (second - first)
    at_second = weight == 1.0
    mixed[at_second] = second[at_second]
    return mixed
