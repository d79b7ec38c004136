"""Assemble joint samples from the parts of a recording: clock, order of time, joints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.recording.joint_samples import complete, counted, JointSamples, Reason, SIGNALS
from lip_id_ros.recording.sample_collector import (
    HEADER,
    Part,
    PUBLISHER,
    RECEIVE,
    SampleCollector,
)
from lip_id_ros.recording.spill import gathered, large_array, marked, release, row_blocks, steps
from lip_id_ros.recording.timing import (
    arrange,
    GAP_STEPS,
    is_one_clock,
    jumps_between_clocks,
    median_step,
    SECOND,
    stamps_advance,
    Timeline,
)

CLOCKS = {'header': HEADER, 'receive': RECEIVE}

_SHOWN_NAMES = 3
_VELOCITY, _EFFORT = 1, 2


class _Source(NamedTuple):
    """What is taken of a part: columns, messages in the order of time, its longest step [ns]."""

    part: Part
    columns: IndexArray
    timeline: Timeline
    longest_ns: float


def assembled(topics: Sequence[SampleCollector], wanted_clock: str) -> JointSamples:
    """
    Return the samples of all joints that the topics of a recording have together.

    `wanted_clock` is 'header', 'receive', or 'auto': headers if those of all parts are times of
    one clock. The topics are used up.

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
            counts[reason] += len(part.numbers)
    clock = clock_of([part for part, _ in chosen], wanted_clock, notes)
    if len(chosen) > 1:
        notes[f'joints of {len(chosen)} publishers were merged in time'] = None
    sources = [_source(part, taken, clock, counts, notes) for part, taken in chosen]
    names = [joint for _, taken in chosen for joint in taken]
    order = np.array([names.index(joint) for joint in joints] if names else [], np.intp)
    timeline, values = merged(sources, order, counts)
    return JointSamples(
        t=timeline.t,
        **dict(zip(SIGNALS, values, strict=True)),
        joint_names=joints,
        start_s=timeline.start_ns / SECOND,
        counts=counted(counts),
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
    publisher = part.numbers[:, PUBLISHER]
    sizes = np.bincount(publisher, minlength=len(part.publishers))
    filled = [~_absent(part, signal) for signal in (_EFFORT, _VELOCITY)]

    def worth(number: int) -> tuple[bool, bool, int]:
        own = publisher == number
        has_effort, has_velocity = (bool((own & has).any()) for has in filled)
        return has_effort, has_velocity, int(sizes[number])

    best = max(range(len(part.publishers)), key=worth)
    counts[Reason.OTHER_PUBLISHER] += int(sizes.sum() - sizes[best])
    notes[
        f'{len(sizes)} publishers have the same joints: the one with {sizes[best]} messages'
        f'{_described(part, best)} was taken'
    ] = None
    rows = np.flatnonzero(publisher == best)
    return part._replace(numbers=part.numbers[rows], values=gathered(part.values, rows))


def _are_apart(part: Part) -> bool:
    """Whether publishers take turns and cannot be one."""
    turns = sum(np.count_nonzero(step) for step in steps(part.numbers[:, PUBLISHER]))
    if turns < len(part.publishers):
        return False  # one after the other
    if len({names for names, _ in part.publishers}) > 1:
        return True
    return not is_one_clock(part.numbers[:, HEADER])


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
    if wanted in CLOCKS:
        return wanted
    headers, received = ([part.numbers[:, clock] for part in parts] for clock in CLOCKS.values())
    if not all(stamps_advance(stamps) for stamps in headers):
        return 'receive'
    if any(jumps_between_clocks(stamps) for stamps in headers) and all(
        stamps_advance(stamps) and not jumps_between_clocks(stamps) for stamps in received
    ):
        notes[
            'the header stamps are those of several clocks: the times of reception were taken'
        ] = None
        return 'receive'
    return 'header'


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


def _source(
    part: Part, taken: Sequence[str], clock: str, counts: Counter[str], notes: dict[str, None]
) -> _Source:
    """Put the usable messages of a part in the order of time; count the others."""
    keep = complete(_absent(part, _VELOCITY), _absent(part, _EFFORT), counts)
    stamps = part.numbers[:, CLOCKS[clock]]
    timeline = arrange(stamps if keep.all() else stamps[keep])
    counts.update(timeline.dropped)
    notes.update(dict.fromkeys(timeline.notes))
    if not keep.all():
        timeline = timeline._replace(rows=np.flatnonzero(keep)[timeline.rows])
    columns = np.array([part.joints.index(joint) for joint in taken])
    return _Source(part, columns, timeline, GAP_STEPS * median_step(timeline.stamps_ns))


def _absent(part: Part, signal: int) -> BoolArray:
    return marked(lambda values: np.isnan(values[:, signal, 0]), part.values)


def merged(
    sources: Sequence[_Source], order: IndexArray, counts: Counter[str]
) -> tuple[Timeline, list[Array]]:
    """
    Bring several sources to the stamps of the one with the fewest, and join their columns.

    Between two samples no further apart than five median steps the others are interpolated
    linearly; at an equal stamp they are taken unchanged. Where there are no two such samples, the
    message is dropped and counted. `order`, shape (n,), is where in the joined columns each joint
    is. Returns the timeline of N samples, and positions, velocities, efforts (N, n).

    """
    if not sources:
        nothing = np.empty(0, np.int64)
        return Timeline(nothing, nothing, Counter()), [np.empty((0, order.size))] * 3
    base = min(sources, key=lambda each: each.timeline.rows.size)
    others = [source for source in sources if source is not base]
    timeline = base.timeline
    if others:
        known = [marked(partial(_is_known, source), timeline.stamps_ns) for source in others]
        kept = np.flatnonzero(np.logical_and.reduce(known))
        counts[Reason.OTHER_JOINTS_AWAY] += timeline.rows.size - kept.size
        timeline = timeline._replace(rows=timeline.rows[kept], stamps_ns=timeline.stamps_ns[kept])
    results = [large_array(timeline.rows.size, order.size) for _ in SIGNALS]
    for block in row_blocks(timeline.rows.size):
        values = [
            _taken(source, timeline.rows[block])
            if source is base
            else _between(source, timeline.stamps_ns[block])
            for source in sources
        ]
        joined = np.concatenate(values, axis=2)[:, :, order]
        for signal, result in enumerate(results):
            result[block] = joined[:, signal]
        release(*results, *(source.part.values for source in sources), *timeline[:2])
    return timeline, results


def _taken(source: _Source, rows: IndexArray) -> Array:
    values: Array = source.part.values[rows][:, :, source.columns]
    return values


def _between(source: _Source, stamps_ns: IntArray) -> Array:
    """Interpolate the values of a source, shape (k, 3, n)."""
    rows = source.timeline.rows
    before, weight, _ = _places(source, stamps_ns)
    first = _taken(source, rows[before])
    if rows.size < 2:
        return first
    second = _taken(source, rows[before + 1])
    share = weight[:, np.newaxis, np.newaxis]
    return np.where(share == 1.0, second, first + share * (second - first))


def _is_known(source: _Source, stamps_ns: IntArray) -> BoolArray:
    return _places(source, stamps_ns)[2]


def _places(source: _Source, wanted: IntArray) -> tuple[IndexArray, Array, BoolArray]:
    """Return for each wanted stamp the sample before, the share of the next, and if both are."""
    given = source.timeline.stamps_ns
    last = given.size - 1
    if last < 1:
        before = np.zeros(wanted.size, np.intp)
        known = wanted == given[0] if last == 0 else np.zeros(wanted.size, bool)
        return before, np.zeros(wanted.size), known
    before = np.searchsorted(given, wanted, side='right') - 1
    exact = given[np.maximum(before, 0)] == wanted
    inside = (before >= 0) & (before < last)
    start = np.clip(before, 0, last - 1)
    step = given[start + 1] - given[start]
    weight = np.where(exact & inside, 0.0, (wanted - given[start]) / step)
    return start, np.clip(weight, 0.0, 1.0), exact | (inside & (step <= source.longest_ns))
