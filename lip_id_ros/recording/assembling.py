"""Collect the messages of topics, and assemble joint samples: clock, order of time, joints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.recording.joint_messages import CLOCKS, HEADER, MessageBlock, PUBLISHER, Publisher
from lip_id_ros.recording.joint_samples import (
    columns_of,
    complete,
    counted,
    JointSamples,
    Reason,
    SIGNALS,
    usable,
)
from lip_id_ros.recording.spill import (
    gathered,
    large_array,
    marked,
    release,
    row_blocks,
    RowStore,
    steps,
)
from lip_id_ros.recording.timing import (
    arrange,
    clock_of,
    GAP_STEPS,
    is_one_clock,
    LATEST_NS,
    median_step,
    SECOND,
    Timeline,
)

_MOST_BLOCKS = 64
_MOST_SEEN = 4096
_MOST_PUBLISHERS = 16
_SMALLEST = np.finfo(np.float64).tiny
_SHOWN_NAMES = 3
_VELOCITY, _EFFORT = 1, 2

Piece = tuple[IndexArray, MessageBlock]
"""Messages, and their numbers among those that were read with them."""


class SampleCollector:
    """
    Collects the usable messages of a topic by the joints that come together; counts the others.

    Attributes
    ----------
    joints : tuple of str
        Joints to keep; those of the first message that can be used, where none are given.
    counts : Counter
        Messages dropped, by reason.
    seen : dict
        Joints of all messages, in the order of their first appearance.
    notes : dict
        What else is to be known, a phrase each; the values mean nothing.

    """

    def __init__(self, joints: Sequence[str] = (), source: str = '', topic: str = '') -> None:
        self.joints = tuple(joints)
        self.source, self.topic = source, topic
        self.counts: Counter[str] = Counter()
        self.seen: dict[str, None] = {}
        self.notes: dict[str, None] = {}
        self._denormal = 0
        self._growing: dict[tuple[str, ...], _GrowingBlock] = {}

    def add(self, pieces: Sequence[Piece]) -> None:
        """Take messages that follow those before in the file, or drop and count them."""
        taken: dict[tuple[str, ...], list[Piece]] = {}
        for rows, block in sorted(pieces, key=lambda piece: int(piece[0][0])):
            if len(self.seen) < _MOST_SEEN:
                self.seen.update(dict.fromkeys(block.joints))
            columns = columns_of(block.joints, self.joints or block.joints)
            if not columns.size:
                self.counts[Reason.FOREIGN_JOINTS] += rows.size
                continue
            keep, block = self._usable(block, columns)
            if not keep.any():
                continue
            self.joints = self.joints or block.joints
            if len(self._growing) == _MOST_BLOCKS and block.joints not in self._growing:
                self.counts[Reason.MISSING_JOINT] += len(block.numbers)
                continue
            self._growing.setdefault(block.joints, _GrowingBlock(block.joints))
            taken.setdefault(block.joints, []).append((rows[keep], block))
        for joints, some in taken.items():
            self._growing[joints].extend(some)

    @property
    def collected_joints(self) -> set[str]:
        """Those of the joints to keep that came."""
        return {joint for joints in self._growing for joint in joints}

    def blocks(self) -> list[MessageBlock]:
        """Return what was collected; nothing may be added any more."""
        if self._denormal:
            self.notes[
                f'{self._denormal} denormal values (memory never filled in) were read as 0'
            ] = None
        return [growing.block() for growing in self._growing.values()]

    def _usable(self, block: MessageBlock, columns: IndexArray) -> tuple[BoolArray, MessageBlock]:
        """Mark the messages that can be used, and return them with the joints to keep."""
        values = block.values[:, :, columns]
        keep = usable(values, self.counts)
        denormal = (np.abs(values) < _SMALLEST) & (values != 0.0)
        self._denormal += int(denormal.sum())
        values[denormal] = 0.0
        joints = tuple(block.joints[column] for column in columns)
        return keep, MessageBlock(joints, block.publishers, block.numbers[keep], values[keep])


class _GrowingBlock:
    """Messages of the same joints, in the order of the file; grows at its end."""

    def __init__(self, joints: tuple[str, ...]) -> None:
        self._joints = joints
        self._numbers = RowStore(3, dtype=np.int64)
        self._values = RowStore(3, len(joints))
        self._publishers: dict[Publisher, int] = {}

    def extend(self, pieces: Sequence[Piece]) -> None:
        """Append messages that follow those before."""
        for _, block in pieces:
            (publisher,) = block.publishers
            if len(self._publishers) <= _MOST_PUBLISHERS:
                self._publishers.setdefault(publisher, len(self._publishers))
            block.numbers[:, PUBLISHER] = self._publishers.get(publisher, 0)
        order = np.argsort(np.concatenate([rows for rows, _ in pieces]))
        numbers = np.concatenate([block.numbers for _, block in pieces])[order]
        self._numbers.extend(np.clip(numbers, -1, LATEST_NS))
        self._values.extend(np.concatenate([block.values for _, block in pieces])[order])

    def block(self) -> MessageBlock:
        """Return what was appended; nothing may be appended any more."""
        too_many = len(self._publishers) > _MOST_PUBLISHERS
        publishers = tuple(self._publishers)[: 1 if too_many else None]
        return MessageBlock(
            self._joints, publishers, self._numbers.values(), self._values.values()
        )


def assembled(topics: Sequence[SampleCollector], wanted_clock: str) -> JointSamples:
    """
    Return the samples of all joints that the topics of a recording have together.

    `wanted_clock` is as for `timing.clock_of`. The topics are used up.

    """
    blocks = [block for topic in topics for block in topic.blocks()]
    counts = sum((topic.counts for topic in topics), Counter[str]())
    notes = {note: None for topic in topics for note in topic.notes}
    joints = next((topic.joints for topic in topics if topic.joints), ())
    blocks = [of_one_publisher(block, counts, notes) for block in blocks]
    chosen = covering(blocks, joints)
    for block in blocks:
        if not any(block is one for one in chosen):
            has_all = set(block.joints) >= set(joints)
            reason = Reason.OTHER_PUBLISHER if has_all else Reason.MISSING_JOINT
            counts[reason] += len(block.numbers)
    headers, received = ([block.numbers[:, k] for block in chosen] for k in CLOCKS.values())
    clock = clock_of(headers, received, wanted_clock, notes)
    if len(chosen) > 1:
        notes[f'joints of {len(chosen)} publishers were merged in time'] = None
    sources = [(block, _in_time(block, clock, counts, notes)) for block in chosen]
    timeline, values = merged(sources, joints, counts)
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

    Again and again the first that has most of those still missing; none where one cannot be had.

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
    """Put the usable messages of a block in the order of time; count the others."""
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
    sources: Sequence[tuple[MessageBlock, Timeline]], joints: Sequence[str], counts: Counter[str]
) -> tuple[Timeline, list[Array]]:
    """
    Bring several blocks to the stamps of the one with the fewest, and join their columns.

    Between two samples no further apart than five median steps the others are interpolated
    linearly; at an equal stamp they are taken unchanged. Where there are no two such samples, the
    message is dropped and counted. Returns the timeline of N samples, and positions, velocities,
    efforts (N, n).

    """
    names = [joint for block, _ in sources for joint in block.joints]
    order = np.array([names.index(joint) for joint in joints] if names else [], np.intp)
    if not sources:
        nothing = np.empty(0, np.int64)
        return Timeline(nothing, nothing, Counter()), [np.empty((0, order.size))] * 3
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
    results = [large_array(timeline.rows.size, order.size) for _ in SIGNALS]
    for rows in row_blocks(timeline.rows.size):
        values = [
            block.values[timeline.rows[rows]]
            if own is base
            else _between(block.values, own, timeline.stamps_ns[rows])
            for block, own in sources
        ]
        joined = np.concatenate(values, axis=2)[:, :, order]
        for signal, result in enumerate(results):
            result[rows] = joined[:, signal]
        release(*results, *(block.values for block, _ in sources), *timeline[:2])
    return timeline, results


def _between(values: Array, timeline: Timeline, wanted: IntArray) -> Array:
    """Interpolate the values of messages to some stamps, shape (k, 3, n)."""
    rows, given = timeline.rows, timeline.stamps_ns
    start = np.clip(np.searchsorted(given, wanted, side='right') - 1, 0, max(0, rows.size - 2))
    after = np.minimum(start + 1, rows.size - 1)
    share = (wanted - given[start]) / np.maximum(given[after] - given[start], 1)
    share = np.clip(share, 0.0, 1.0)[:, np.newaxis, np.newaxis]
    first, second = values[rows[start]], values[rows[after]]
    return np.where(share == 1.0, second, first + share * (second - first))


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
