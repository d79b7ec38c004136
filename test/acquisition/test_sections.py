"""One wrong stamp spoils nothing; a clock that jumped is followed; every message is counted."""

from __future__ import annotations

from collections.abc import Iterable
import math
from types import SimpleNamespace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.acquisition.sections import MOST_SECTIONS, Sections
from lip_id_ros.recording import Reason
from lip_id_ros.recording.joint_messages import from_joint_state, JointMessage
from lip_id_ros.signals.joint_states import JUMP_CONFIRMED_BY, LONGEST_STAMP_STEP_S

NAMES = ('a', 'b')
NOW = 1.7e9


def message(stamp_s: float, *values: float) -> JointMessage:
    position = list(values) or [1.0, 2.0]
    return JointMessage(round(stamp_s * 1e9), NAMES, position, position, position)


def filled(stamps: Iterable[float], max_rows: int = 1000) -> Sections:
    sections = Sections(NAMES, max_rows)
    for stamp in stamps:
        sections.add(message(stamp))
    return sections


def stamps_of(sections: Sections) -> list[list[float]]:
    return [(each.start_s + each.t).round(6).tolist() for each in sections.samples('t')]


PAUSE = 3 * LONGEST_STAMP_STEP_S
AHEAD, BACK = 'stamp far ahead', 'stamp went back'
STREAMS: dict[str, tuple[list[float], list[list[float]], dict[str, int]]] = {
    'one stamp far ahead': (
        [NOW, NOW + 0.1, NOW + 1e6, NOW + 0.2, NOW + 0.3],
        [[NOW, NOW + 0.1, NOW + 0.2, NOW + 0.3]],
        {AHEAD: 1},
    ),
    'a first stamp far ahead': (
        [NOW + 1e6, NOW, NOW + 0.1, NOW + 0.2, NOW + 0.3],
        [[NOW + 1e6], [NOW, NOW + 0.1, NOW + 0.2, NOW + 0.3]],
        {},
    ),
    'a late message': ([1.0, 1.2, 1.1, 1.3], [[1.0, 1.2, 1.3]], {BACK: 1}),
    'a clock that may have restarted': ([9.0, 9.1, 0.5, 0.6], [[9.0, 9.1]], {BACK: 2}),
    'a restarted clock': ([9.0, 9.1, 0.5, 0.6, 0.7, 0.8], [[9.0, 9.1], [0.5, 0.6, 0.7, 0.8]], {}),
    'a pause': (
        [1.0, 1.1, PAUSE, PAUSE + 0.1, PAUSE + 0.2],
        [[1.0, 1.1, PAUSE, PAUSE + 0.1, PAUSE + 0.2]],
        {},
    ),
    'two clocks at once': (
        [stamp + offset for stamp in (1.0, 2.0, 3.0, 4.0, 5.0) for offset in (0.0, NOW)],
        [[1.0, 2.0, 3.0, 4.0, 5.0]],
        {AHEAD: 5},
    ),
}


@pytest.mark.parametrize('kind', STREAMS)
def test_a_clock_is_followed_and_a_wrong_stamp_rejected(kind: str) -> None:
    stamps, kept, counts = STREAMS[kind]
    sections = filled(stamps)
    assert stamps_of(sections) == kept
    assert sections.counts == counts


def test_flaws_of_doubted_messages_keep_their_reason() -> None:
    sections = filled([100.0])
    sections.add(message(1.0))
    sections.add(message(1.0))
    sections.add(message(1.1, math.nan, 0.0))
    sections.add(message(1.2, 0.0))
    sections.add(message(1.3))
    sections.add(message(1.4))
    assert stamps_of(sections) == [[100.0], [1.0, 1.3, 1.4]]
    assert sections.counts == {
        'stamp repeated': 1,
        'value not finite': 1,
        'position not as long as names': 1,
    }


def test_foreign_messages_with_other_stamps_begin_no_section() -> None:
    sections = Sections((), 1000)
    sections.add(message(100.0))
    for stamp in (1.0, 1.1, 1.2, 1.3):
        foreign = JointMessage(round(stamp * 1e9), ['finger'], [0.0], [0.0], [0.0])
        assert sections.add(foreign) is Reason.FOREIGN_JOINTS
    sections.add(message(100.1))
    assert stamps_of(sections) == [[100.0, 100.1]]
    assert sections.counts == {'only foreign joints': 4}


def test_foreign_messages_hide_no_jump_of_the_clock() -> None:
    sections = Sections((), 1000)
    sections.add(message(100.0))
    for step in range(6):
        sections.add(message(1.0 + 0.1 * step))
        foreign = JointMessage(round((500.0 + step) * 1e9), ['finger'], [0.0], [0.0], [0.0])
        assert sections.add(foreign) is Reason.FOREIGN_JOINTS
    assert stamps_of(sections) == [[100.0], [1.0, 1.1, 1.2, 1.3, 1.4, 1.5]]
    assert sections.counts == {'only foreign joints': 6}


def test_sections_share_one_bound() -> None:
    stamps = [100.0, 100.1, *np.arange(1.0, 2.0, 0.1)]
    sections = filled(stamps, max_rows=6)
    assert [len(each) for each in stamps_of(sections)] == [2, 4]
    assert sections.is_full
    assert sections.counts == {'buffer full': 6}


def test_a_clock_that_goes_back_without_end_takes_no_memory_without_end() -> None:
    descending = [
        1e6 - 100.0 * fall + step for fall in range(500) for step in range(JUMP_CONFIRMED_BY)
    ]
    sections = filled(descending, max_rows=10_000)
    assert len(sections.samples('t')) == MOST_SECTIONS
    assert len(sections) + sections.counts.total() == len(descending)


def test_clear_forgets_sections_and_doubts() -> None:
    sections = filled([100.0, 1.0, 1.1, 1.2, 0.5])
    sections.clear()
    assert (len(sections), sections.counts, sections.samples('t')) == (0, {}, [])
    sections.add(message(2.0))
    assert stamps_of(sections) == [[2.0]]


def ros_message(**fields: Any) -> SimpleNamespace:
    sec, nanosec = fields.pop('stamp')
    stamp = SimpleNamespace(sec=sec, nanosec=nanosec)
    header = SimpleNamespace(stamp=stamp, frame_id='')
    return SimpleNamespace(header=header, **fields)


NUMBERS = st.lists(st.floats(), max_size=4)
ANY = st.builds(
    ros_message,
    stamp=st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)),
    name=st.lists(st.sampled_from(['a', 'b', 'c', '']), max_size=4),
    position=NUMBERS,
    velocity=NUMBERS,
    effort=NUMBERS,
)
GOOD = st.builds(
    ros_message,
    stamp=st.tuples(st.integers(0, 40), st.integers(0, 999_999_999)),
    name=st.permutations(NAMES),
    position=st.just([1.0, 2.0]),
    velocity=st.just([1.0, 2.0]),
    effort=st.just([1.0, 2.0]),
)


@given(st.lists(ANY | GOOD, max_size=60), st.sampled_from([NAMES, ()]), st.integers(1, 40))
def test_all_is_kept_or_counted(stream: list[Any], joints: tuple[str, ...], max_rows: int) -> None:
    sections = Sections(joints, max_rows)
    for came, each in enumerate(stream, start=1):
        sections.add(from_joint_state(each))
        assert len(sections) + sections.counts.total() == came
        assert len(sections) <= max_rows
    assert all(count > 0 for count in sections.counts.values())
    for samples in sections.samples('t'):
        assert (np.diff(samples.t) > 0).all()
        assert np.isfinite(samples.position).all()


WRONG = st.floats(-1e6, -1.0) | st.floats(1e3, 1e6)


@given(st.dictionaries(st.integers(0, 199), WRONG, max_size=100))
def test_lone_wrong_stamps_cost_only_themselves(wrong: dict[int, float]) -> None:
    sections = Sections(NAMES, 1000)
    for row in range(200):
        sections.add(message(NOW + 0.01 * row, row, row))
        if row in wrong:
            sections.add(message(NOW + wrong[row], -1.0, -1.0))
    (samples,) = sections.samples('t')
    np.testing.assert_array_equal(samples.position[:, 0], np.arange(200.0))
    assert sections.counts.total() == len(wrong)


@given(
    st.integers(1, 8),
    st.lists(st.sampled_from([0.1, 0.1, 0.1, 0.1, -50.0, 30.0]), min_size=1, max_size=60),
)
def test_the_bound_holds_wherever_the_clock_goes(max_rows: int, steps: list[float]) -> None:
    sections = filled(NOW + np.cumsum(steps), max_rows)
    assert len(sections) <= max_rows
    assert sum(len(stamps) for stamps in stamps_of(sections)) == len(sections)
    assert len(sections) + sections.counts.total() == len(steps)


def test_a_clock_that_goes_back_at_the_bound_adds_nothing() -> None:
    falls = [NOW - 100.0 * fall + step for fall in range(8) for step in (0.0, 0.1, 0.2, 0.3)]
    assert [len(filled(falls, max_rows)) for max_rows in (3, 5, 7, 8)] == [3, 4, 7, 8]
