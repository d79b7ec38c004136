"""Clocks, order, rates and gaps of recordings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.recording.joint_samples import Reason
from lip_id_ros.recording.spill import mapped, release, row_numbers, steps

GAP_STEPS = 5.0
"""A step of more than so many median steps is a gap, unless set otherwise."""

SECOND = 1_000_000_000
LATEST_NS = 2**62
FAR_NS = 10 * SECOND
"""A stamp out of order by more than this is wrong, and not late."""
END_NS = 3600 * SECOND
"""Nor has a recording a few lone stamps at its ends that are so far from all others."""
RESTART_NS = SECOND
APART_NS = 3600 * SECOND
"""What was recorded after the clock went back for good is put so long after what was before."""
WENT_BACK = 'the clock went back for good'
MOST_STEPS = 2**20
"""Of so many steps the median is that of all."""

_MIN_FORWARD = 0.25
_NEIGHBOURS = 11
_RUN = 20
_MOSTLY = 0.8
_LATE_PLACES = 5
_MOST_LATE = 0.1
_MOST_RESTARTS = 3
_MOST_SET_BACK = 1000
_SET_BACK_STEPS = 12.0
_CANDIDATES = 50_000
_STEP_BLOCKS = 16
_END_OF_TIME = 2**63 - 1


class Timeline(NamedTuple):
    """
    Stamps put in order: the `rows` kept, and their strictly increasing `stamps_ns`.

    `late`: how many of those kept came after a later one. `restarts`: how often the clock went
    back for good.
    """

    rows: IndexArray
    stamps_ns: IntArray
    dropped: Counter[str]
    late: int = 0
    restarts: int = 0

    @property
    def start_ns(self) -> int:
        """Stamp of the first message, 0 where there is none."""
        return int(self.stamps_ns[0]) if self.stamps_ns.size else 0

    @property
    def t(self) -> Array:
        """Time of each message since the first [s]."""
        return mapped(lambda stamps: (stamps - self.start_ns) / SECOND, self.stamps_ns)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was put in order, one phrase each."""
        late = f'{self.late} messages came late and were put where they belong'
        restarts = f'{WENT_BACK} {self.restarts} times: what follows was put an hour later'
        phrases = ((self.late, late), (self.restarts, restarts))
        return tuple(phrase for count, phrase in phrases if count)


def stamps_advance(stamps_ns: IntArray) -> bool:
    """
    Whether stamps in the order of recording advance as times do.

    At least a quarter of the steps go forward, and more of them forward than back. A first stamp
    of 0 or 1 ns is as good as any; stamps that are constant (never filled in) or random are not.
    """
    forward = sum(int((step > 0).sum()) for step in steps(stamps_ns))
    backward = sum(int((step < 0).sum()) for step in steps(stamps_ns))
    return forward >= _MIN_FORWARD * (len(stamps_ns) - 1) and forward >= backward


def is_one_clock(stamps_ns: IntArray) -> bool:
    """Whether most steps are alike, as those of one publisher are."""
    some = some_steps(stamps_ns)
    forward = some[some > 0]
    typical = float(np.median(forward)) if forward.size else 0.0
    return bool((np.abs(some - typical) <= 0.5 * typical).mean() >= _MOSTLY)


def jumps_between_clocks(stamps_ns: IntArray) -> bool:
    """
    Whether stamps that advance are those of several clocks, or of one that begins again and again.

    They are if the clock goes back for good more than three times, or if more than a tenth of the
    messages would have to move by more than five places to be in order.
    """
    if not any((step < 0).any() for step in steps(stamps_ns)):
        return False
    rows = _plausible(stamps_ns, np.arange(stamps_ns.size), Counter(), is_epoch=True)
    stamps = stamps_ns[rows]
    restarts = _restarts(stamps)
    if restarts.size > _MOST_RESTARTS:
        return True
    order = np.argsort(_in_parts(stamps, restarts), kind='stable')
    places = np.abs(order - np.arange(order.size))
    return bool((places > _LATE_PLACES).sum() > _MOST_LATE * places.size)


def clock_of(
    headers: Sequence[IntArray], received: Sequence[IntArray], wanted: str, notes: dict[str, None]
) -> str:
    """
    Return the clock to take: 'header' or 'receive', as wanted, else whichever is of one clock.

    `headers`, `received`: stamps of several publishers in the order of recording [ns]. `wanted`:
    'auto' for headers if those of all publishers are times of one clock, else with a note.
    """
    if wanted in ('header', 'receive'):
        return wanted
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


def arrange(stamps_ns: IntArray, *, is_epoch: bool = True) -> Timeline:
    """
    Put messages in the order of time, given stamps in the order of recording.

    Late messages are put where they belong. Of equal stamps the first message is kept. Dropped are
    negative stamps, zeros that are not the first (both only if stamps count from an epoch), and
    single stamps that are out of order and more than 10 s from their neighbours, so that one stamp
    from the future does not make all later ones late. Where the clock goes back for good (a
    restarted simulation), what follows is a part of its own, an hour after the part before.
    """
    is_wrong = is_epoch and bool((stamps_ns[:1] < 0).any())
    if not is_wrong and not _far_end(stamps_ns) and _increase(stamps_ns):
        stamps = mapped(np.array, stamps_ns)
        return Timeline(row_numbers(stamps.size), stamps, Counter())
    dropped = Counter[str]()
    rows = _plausible(stamps_ns, np.arange(stamps_ns.size), dropped, is_epoch=is_epoch)
    stamps = stamps_ns[rows]
    restarts = _restarts(stamps)
    late = 0
    if restarts.size or not _increase(stamps):
        stamps = _in_parts(stamps, restarts)
        dropped[Reason.STRAY_STAMP] += rows.size - stamps.size
        rows = rows[: stamps.size]
        late = int((stamps < np.maximum.accumulate(stamps)).sum())
        order = np.argsort(stamps, kind='stable')
        rows, stamps = rows[order], stamps[order]
        first = np.concatenate([np.ones(min(1, stamps.size), bool), np.diff(stamps) > 0])
        dropped[Reason.REPEATED_STAMP] += int((~first).sum())
        rows, stamps = rows[first], stamps[first]
    return Timeline(rows, stamps, +dropped, late, restarts.size)


def _increase(stamps: IntArray) -> bool:
    return all((step > 0).all() for step in steps(stamps))


def _plausible(
    stamps: IntArray, rows: IndexArray, dropped: Counter[str], *, is_epoch: bool
) -> IndexArray:
    negative, zero = (stamps < 0) & is_epoch, (stamps == 0) & is_epoch
    zero[:1] = False
    rows = rows[~(negative | zero)]
    far = _far(stamps[rows])
    far_zeros = int((stamps[rows[far]] == 0).sum()) if is_epoch else 0
    dropped[Reason.BAD_STAMP] += int(negative.sum())
    dropped[Reason.ZERO_STAMP] += int(zero.sum()) + far_zeros
    dropped[Reason.STRAY_STAMP] += int(far.sum()) - far_zeros
    return rows[~far]


def _far_end(stamps: IntArray) -> bool:
    ends = (stamps[:_NEIGHBOURS], stamps[-_NEIGHBOURS:])
    return any(end.size > 0 and int(np.ptp(end)) > END_NS for end in ends)


def _far(stamps: IntArray) -> BoolArray:
    """Mark stamps far from the median of their neighbours, out of order or at an end."""
    size = min(_NEIGHBOURS, stamps.size - 1 + stamps.size % 2)
    if size < 3:
        return np.zeros(stamps.size, bool)
    from scipy.ndimage import median_filter  # live nodes start without it

    distance = np.abs(stamps - median_filter(stamps, size, mode='mirror'))
    reach = size // 2
    at_end = np.ones(stamps.size, bool)
    at_end[reach:-reach] = False
    disordered = np.zeros(stamps.size, bool)
    for step in range(1, reach + 1):
        back = stamps[step:] < stamps[:-step]
        disordered[step:] |= back
        disordered[:-step] |= back
    far: BoolArray = (distance > FAR_NS) & (disordered | (at_end & (distance > END_NS)))
    return far


def _restarts(stamps: IntArray) -> IndexArray:
    """Return where the clock goes back for good, or a part of a second over stamps from before."""
    back = np.flatnonzero(np.diff(stamps) < 0) + 1
    back = back[(back >= _RUN) & (back <= stamps.size - _RUN)]
    far = back[stamps[back] < stamps[back - 1] - RESTART_NS]
    found = [_for_good(stamps, far[k : k + _CANDIDATES]) for k in range(0, far.size, _CANDIDATES)]
    if 0 < back.size <= _MOST_SET_BACK:
        step = median_step(stamps)
        found.append(
            np.array([at for at in back.tolist() if _is_set_back(stamps, at, step)], np.intp)
        )
    return np.unique(np.concatenate(found)) if found else far


def _is_set_back(stamps: IntArray, at: int, step: float) -> bool:
    """
    Return whether a clock was set back before a message, so that stamps come twice as densely.

    Late messages fill a hole that those before them left. Those of a clock that was set back take
    turns with them, and both are in order. Messages that came twice have stamps from before, as
    only those on a grid have by chance.
    """
    back = float(stamps[at - 1] - stamps[at])
    if not 0.0 < _SET_BACK_STEPS * step < back < FAR_NS:
        return False
    count = int(2.0 * back / step) + _RUN
    before, after = stamps[max(0, at - count) : at], stamps[at : at + count]
    if not (_increase(before) and _increase(after)):
        return False
    before, after = before[before >= stamps[at]], after[after <= stamps[at - 1]]
    if np.any(np.diff(after) % step):
        after = after[~np.isin(after, before)]
    is_after = np.repeat([False, True], [before.size, after.size])
    order = np.argsort(np.concatenate([before, after]), kind='stable')
    turns = np.count_nonzero(np.diff(is_after[order]))
    return bool(turns > min(before.size, after.size))


def _for_good(stamps: IntArray, places: IndexArray) -> IndexArray:
    runs, at = np.arange(_RUN), places[:, np.newaxis]
    earliest, latest = stamps[at - 1 - runs].min(axis=1), stamps[at + runs].max(axis=1)
    found: IndexArray = places[earliest > latest + RESTART_NS]
    return found


def _in_parts(stamps: IntArray, restarts: IndexArray) -> IntArray:
    """Put what follows a restart an hour later; leave out what would be later than any clock."""
    shifted = stamps.copy()
    latest = int(stamps[: restarts[0]].max()) if restarts.size else 0
    for begin, end in pairwise([*restarts.tolist(), stamps.size]):
        part = stamps[begin:end]
        shift = latest + APART_NS - int(part.min())
        latest = int(part.max()) + shift
        if latest > _END_OF_TIME:
            return shifted[:begin]
        shifted[begin:end] += shift
    return shifted


def some_steps(values: NDArray[Any], most: int | None = None) -> NDArray[Any]:
    """Return the differences of successive values; of more than `most`, those of 16 blocks."""
    most = MOST_STEPS if most is None else most
    if values.size <= max(most, _STEP_BLOCKS):
        return np.diff(values)
    length = max(1, most // _STEP_BLOCKS)
    starts = np.linspace(0, values.size - length - 1, _STEP_BLOCKS).astype(int).tolist()
    found = [np.diff(values[start : start + length + 1]) for start in starts]
    release(values)
    return np.concatenate(found)


def median_step(t: NDArray[Any]) -> float:
    """Return the median step of increasing times, in their unit; 0 for fewer than two."""
    return float(np.median(some_steps(t))) if t.size > 1 else 0.0


def gap_starts(t: Array, longest_s: float) -> IndexArray:
    """Return the index of the last sample before each step longer than `longest_s`."""
    found, offset = [np.empty(0, np.intp)], 0
    for step in steps(t):
        found.append(offset + np.flatnonzero(step > longest_s))
        offset += step.size
    return np.concatenate(found)
