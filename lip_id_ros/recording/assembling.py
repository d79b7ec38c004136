"""Assemble joint samples of the messages of topics: clock, order of time, joints, efforts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.recording.collecting import SampleCollector
from lip_id_ros.recording.joint_messages import CLOCKS, HEADER, MessageBlock, PUBLISHER
from lip_id_ros.recording.joint_samples import complete, counted, JointSamples, Reason, SIGNALS
from lip_id_ros.recording.spill import gathered, large_array, marked, release, row_blocks, steps
from lip_id_ros.recording.timing import (
    arrange,
    clock_of,
    GAP_STEPS,
    is_one_clock,
    median_step,
    Timeline,
)

_SHOWN_NAMES = 3
_VELOCITY, _EFFORT = 1, 2
_WHOLE = 1.5
"""Messages that take longer than so many usual steps have a hole, which no mean bridges."""
_MOST_AVERAGED = 1000.0


def assembled(topics: Sequence[SampleCollector], wanted_clock: str) -> JointSamples:
    """
    Return the samples of all joints that the topics of a recording have together.

    Where no message with positions has an effort, efforts that came alone are joined with them.
    `wanted_clock` is as for `timing.clock_of`. The topics are used up.
    """
    blocks = [block for topic in topics for block in topic.blocks()]
    counts = sum((topic.counts for topic in topics), Counter[str]())
    notes = {note: None for topic in topics for note in topic.notes}
    joints = next((topic.joints for topic in topics if topic.joints), ())
    blocks = [of_one_publisher(block, counts, notes) for block in blocks]
    placed, efforts = _chosen(blocks, joints, counts)
    chosen = [*placed, *efforts]
    headers, received = ([block.numbers[:, k] for block in chosen] for k in CLOCKS.values())
    clock = clock_of(headers, received, wanted_clock, notes)
    if len(placed) > 1:
        notes[f'joints of {len(placed)} publishers were merged in time'] = None
    if efforts:
        notes['efforts came in messages of their own and were joined in time'] = None
    sources = [(block, _in_time(block, clock, counts, notes)) for block in chosen]
    columns = [_columns(placed, joints)] * len(SIGNALS)
    if efforts:
        beside = sum(len(block.joints) for block in placed)
        columns[_EFFORT] = beside + _columns(efforts, joints)
    timeline, values = merged(sources, columns, counts)
    return JointSamples(
        t=timeline.t,
        **dict(zip(SIGNALS, values, strict=True)),
        joint_names=joints,
        start_ns=timeline.start_ns,
        counts=counted(counts),
        source=', '.join(dict.fromkeys(topic.source for topic in topics)),
        topic=', '.join(dict.fromkeys(topic.topic for topic in topics)),
        seen_joints=tuple(dict.fromkeys(name for topic in topics for name in topic.seen)),
        clock=clock,
        notes=tuple(notes),
    )


def _chosen(
    blocks: Sequence[MessageBlock], joints: Sequence[str], counts: Counter[str]
) -> tuple[list[MessageBlock], list[MessageBlock]]:
    """Choose blocks with positions, and where these lack efforts, efforts; count the others."""
    placed = covering([block for block in blocks if block.has_position], joints)
    alone = [block for block in blocks if not block.has_position]
    efforts = []
    if alone and placed and all(_absent(block, _EFFORT).all() for block in placed):
        efforts = covering(alone, joints)
    for block in blocks:
        if not any(block is one for one in (*placed, *efforts)):
            has_all = set(block.joints) >= set(joints)
            reason = Reason.OTHER_PUBLISHER if has_all else Reason.MISSING_JOINT
            counts[reason if block.has_position else Reason.NO_POSITION] += len(block.numbers)
    return placed, efforts


def _columns(blocks: Sequence[MessageBlock], joints: Sequence[str]) -> IndexArray:
    """Return where in the joined columns of blocks each joint is; empty for no blocks."""
    names = [joint for block in blocks for joint in block.joints]
    return np.array([names.index(joint) for joint in joints] if names else [], np.intp)


def of_one_publisher(
    block: MessageBlock, counts: Counter[str], notes: dict[str, None]
) -> MessageBlock:
    """
    Return the messages of one publisher, where several publish the same joints.

    Messages with the same joints that differ in their frame are of one publisher if their header
    stamps are those of one clock. Of several publishers the one is taken that has effort and
    velocity, and then the one with the most messages; the others are counted.
    """
    if len(block.publishers) < 2 or not _are_apart(block):
        return block
    publisher = block.numbers[:, PUBLISHER]
    sizes = np.bincount(publisher, minlength=len(block.publishers))
    filled = [~_absent(block, signal) for signal in (_EFFORT, _VELOCITY)]

    def worth(number: int) -> tuple[bool, bool, int]:
        own = publisher == number
        has_effort, has_velocity = (bool((own & has).any()) for has in filled)
        return has_effort, has_velocity, int(sizes[number])

    best = max(range(len(block.publishers)), key=worth)
    counts[Reason.OTHER_PUBLISHER] += int(sizes.sum() - sizes[best])
    notes[
        f'{len(sizes)} publishers have the same joints: the one with {sizes[best]} messages'
        f'{_described(block, best)} was taken'
    ] = None
    rows = np.flatnonzero(publisher == best)
    return block._replace(numbers=block.numbers[rows], values=gathered(block.values, rows))


def _are_apart(block: MessageBlock) -> bool:
    """Whether publishers take turns and cannot be one."""
    turns = sum(np.count_nonzero(step) for step in steps(block.numbers[:, PUBLISHER]))
    if turns < len(block.publishers):
        return False  # one after the other
    if len({names for names, _ in block.publishers}) > 1:
        return True
    return not is_one_clock(block.numbers[:, HEADER])


def _described(block: MessageBlock, number: int) -> str:
    names, frame = block.publishers[number]
    extra = sorted(names - set(block.joints))
    if extra:
        more = ', ...' if len(extra) > _SHOWN_NAMES else ''
        return f' (it also has {", ".join(extra[:_SHOWN_NAMES])}{more})'
    if len({frame for _, frame in block.publishers}) > 1:
        return f' (its frame is {frame!r})'
    return ' (it has no other joints)'


def covering(blocks: Sequence[MessageBlock], joints: Sequence[str]) -> list[MessageBlock]:
    """
    Choose blocks that have all joints together; a joint is to be taken from the first that has it.

    Again and again the first that has most of those missing; none where one cannot be had.
    """
    missing = set(joints)
    chosen: list[MessageBlock] = []
    while missing:
        best = max(blocks, key=lambda block: len(missing & {*block.joints}), default=None)
        if best is None or not missing & {*best.joints}:
            return []
        chosen.append(best)
        missing -= {*best.joints}
    return chosen


def _in_time(
    block: MessageBlock, clock: str, counts: Counter[str], notes: dict[str, None]
) -> Timeline:
    keep = complete(_absent(block, _VELOCITY), _absent(block, _EFFORT), counts)
    stamps = block.numbers[:, CLOCKS[clock]]
    timeline = arrange(stamps if keep.all() else stamps[keep])
    counts.update(timeline.dropped)
    notes.update(dict.fromkeys(timeline.notes))
    if keep.all():
        return timeline
    return timeline._replace(rows=np.flatnonzero(keep)[timeline.rows])


def _absent(block: MessageBlock, signal: int) -> BoolArray:
    return marked(lambda values: np.isnan(values[:, signal, 0]), block.values)


def merged(
    sources: Sequence[tuple[MessageBlock, Timeline]],
    columns: Sequence[IndexArray],
    counts: Counter[str],
) -> tuple[Timeline, list[Array]]:
    """
    Bring several blocks to the stamps of the one with the fewest, and join their columns.

    Between two samples no further apart than five median steps the others are interpolated
    linearly, velocities and efforts of faster ones after averaging over a step of the slow one,
    so that nothing fast is taken for slow. Where there are no two such samples, the message is
    dropped and counted. `columns` says where in the joined columns the joints of each
    signal are. Returns the timeline of N samples, and positions, velocities, efforts (N, n).
    """
    if not sources:
        nothing = np.empty(0, np.int64)
        return Timeline(nothing, nothing, Counter()), [np.empty((0, 0))] * len(SIGNALS)
    base = min((timeline for _, timeline in sources), key=lambda each: each.rows.size)
    others = [own.stamps_ns for _, own in sources if own is not base]
    timeline = base
    if others:
        known = [
            marked(partial(_is_known, each, GAP_STEPS * median_step(each)), base.stamps_ns)
            for each in others
        ]
        kept = np.flatnonzero(np.logical_and.reduce(known))
        counts[Reason.OTHER_JOINTS_AWAY] += base.rows.size - kept.size
        timeline = base._replace(rows=base.rows[kept], stamps_ns=base.stamps_ns[kept])
    results = [large_array(timeline.rows.size, each.size) for each in columns]
    for rows in row_blocks(timeline.rows.size):
        values = [
            block.values[timeline.rows[rows]]
            if own is base
            else _between(block.values, own, timeline.stamps_ns[rows], _weights(own, base))
            for block, own in sources
        ]
        joined = np.concatenate(values, axis=2)
        for signal, result in enumerate(results):
            result[rows] = joined[:, signal, columns[signal]]
        release(*results, *(block.values for block, _ in sources), *timeline[:2])
    return timeline, results


def _weights(timeline: Timeline, base: Timeline) -> Array:
    """
    Return the weights of faster messages around each one: a box b over a slow step, made flat.

    What b damps of slow motion, 2 b - b * b gives back but for the square of it (twicing: Tukey,
    Exploratory Data Analysis, 1977), and multiples of the slow rate stay at zero.
    """
    step = median_step(timeline.stamps_ns)
    ratio = median_step(base.stamps_ns) / step if step > 0.0 else 1.0
    beside = 0.5 * (np.clip(ratio, 1.0, _MOST_AVERAGED) - 1.0)
    inner = int(beside)
    box = np.pad(np.ones(2 * inner + 1), 1, constant_values=beside - inner)
    box /= box.sum()
    return np.trim_zeros(2.0 * np.pad(box, inner + 1) - np.convolve(box, box))


def _between(values: Array, timeline: Timeline, wanted: IntArray, weights: Array) -> Array:
    """Interpolate the values of messages to some stamps, shape (k, 3, n)."""
    rows, given = timeline.rows, timeline.stamps_ns
    start = np.clip(np.searchsorted(given, wanted, side='right') - 1, 0, max(0, rows.size - 2))
    after = np.minimum(start + 1, rows.size - 1)
    share = (wanted - given[start]) / np.maximum(given[after] - given[start], 1)
    share = np.clip(share, 0.0, 1.0)[:, np.newaxis, np.newaxis]
    first, second = (_averaged(values, timeline, each, weights) for each in (start, after))
    return np.where(share == 1.0, second, first + share * (second - first))


def _averaged(values: Array, timeline: Timeline, at: IndexArray, weights: Array) -> Array:
    """Return messages whose velocities and efforts are means, where none is missing beside."""
    rows, given, reach = timeline.rows, timeline.stamps_ns, weights.size // 2
    means = values[rows[at]]
    first, last = np.maximum(at - reach, 0), np.minimum(at + reach, rows.size - 1)
    longest = _WHOLE * 2.0 * reach * median_step(given)
    whole = (last - first == 2 * reach) & (given[last] - given[first] <= longest)
    if reach and whole.any():
        some = at[whole] - reach
        around = (w * values[rows[some + k], _VELOCITY:] for k, w in enumerate(weights))
        means[whole, _VELOCITY:] = sum(around)
    return means


def _is_known(given: IntArray, longest_ns: float, wanted: IntArray) -> BoolArray:
    """Mark stamps that are given, or lie between two that are no further apart than allowed."""
    if not given.size:
        return np.zeros(wanted.size, bool)
    after = np.searchsorted(given, wanted)
    before, after = np.maximum(after - 1, 0), np.minimum(after, given.size - 1)
    inside = (given[before] < wanted) & (wanted < given[after])
    near = given[after] - given[before] <= longest_ns
    known: BoolArray = (given[after] == wanted) | (inside & near)
    return known
