"""The way of a goal through `serve`: each ends once, and all are counted."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import pytest

from lip_id_ros.feedforward import goals
from lip_id_ros.feedforward.goals import (
    Ending,
    ErrorCode,
    GoalCounts,
    Outcome,
    Relayed,
    WatchedTime,
)
from lip_id_ros.signals.joints import Refusal, RefusedError

ACTION = '/arm_controller/follow_joint_trajectory'
OUTCOMES = [
    Outcome(Ending.SUCCEEDED, ErrorCode.SUCCESSFUL, ''),
    Outcome(Ending.CANCELED, ErrorCode.INVALID_GOAL, 'preempted'),
    goals.rejected(ACTION),
    goals.lost(ACTION, 'has ended'),
    goals.released(),
    goals.refused(Refusal.MISSING_JOINT, 'a joint is missing'),
]


@given(st.lists(st.lists(st.sampled_from(OUTCOMES))))
def test_every_goal_ends_once_and_the_counts_add_up(ends: list[list[Outcome]]) -> None:
    counts = GoalCounts()
    for outcomes in ends:
        counts.received += 1
        relayed = Relayed(0.0)
        for outcome in outcomes:
            if relayed.end(outcome):
                counts.end(outcome)
        assert relayed.outcome == (outcomes[0] if outcomes else None)
    values = counts.values()
    assert values['running'] == sum(not outcomes for outcomes in ends)
    assert values['received'] == values['running'] + sum(values['refused'].values()) + sum(
        values[ending] for ending in ('succeeded', 'aborted', 'canceled')
    )


@pytest.mark.parametrize('reason', Refusal)
def test_what_cannot_be_filled_has_a_code_and_a_sentence(reason: Refusal) -> None:
    outcome = goals.refused(reason, str(RefusedError(reason)))
    of_names = 'joint' in reason and reason is not Refusal.FOREIGN_JOINTS
    assert outcome.code == (ErrorCode.INVALID_JOINTS if of_names else ErrorCode.INVALID_GOAL)
    assert outcome.sentence.startswith('serve: ')
    assert outcome.sentence.endswith('.')


def test_the_controller_is_asked_to_cancel_once_it_has_the_goal() -> None:
    relayed = Relayed(0.0)
    assert not relayed.cancel(1.0)
    assert relayed.accept(1.0)
    later = Relayed(0.0)
    assert not later.accept(1.0)
    assert later.cancel(1.0)
    later.end(goals.released())
    assert not later.cancel(1.0)


def test_a_goal_that_ended_before_its_answer_is_cancelled_then() -> None:
    relayed = Relayed(0.0)
    relayed.end(goals.lost(ACTION, 'has not answered'))
    assert relayed.accept(1.0)


def test_a_controller_that_does_not_answer_is_silent() -> None:
    relayed = Relayed(10.0)
    assert not relayed.is_silent(10.0 + goals.LONGEST_SILENCE_S)
    assert relayed.is_silent(10.1 + goals.LONGEST_SILENCE_S)
    relayed.accept(1.0)
    assert not relayed.is_silent(100.0)


def test_a_node_that_stood_still_does_not_take_its_controller_for_silent() -> None:
    time = WatchedTime()
    time.advance(100.0)
    relayed = Relayed(time.now)
    for steady in (160.0, 220.0, 220.1):  # the answer may have come in these pauses
        time.advance(steady)
    assert not relayed.is_silent(time.now)
    assert time.now == pytest.approx(2 * goals.LONGEST_STEP_S + 0.1)
    time.advance(0.0)  # no steady clock does that
    assert time.now == pytest.approx(2 * goals.LONGEST_STEP_S + 0.1)


def test_a_goal_that_was_cancelled_ends_even_if_the_controller_forgets_it() -> None:
    relayed = Relayed(0.0)
    relayed.cancel(1.0)
    assert not relayed.is_forgotten(50.0)
    relayed.accept(60.0)
    assert not relayed.is_forgotten(60.0 + goals.LONGEST_CANCEL_S)
    assert relayed.is_forgotten(60.1 + goals.LONGEST_CANCEL_S)
    assert goals.forgotten(ACTION).ending is Ending.CANCELED


def test_a_result_that_was_lost_is_asked_for_again_and_again() -> None:
    relayed = Relayed(0.0)
    assert not relayed.lacks_result(False, 50.0)
    assert not relayed.lacks_result(True, 60.0)
    assert not relayed.lacks_result(True, 60.0 + goals.ASK_AGAIN_S)
    assert relayed.lacks_result(True, 60.1 + goals.ASK_AGAIN_S)
    assert not relayed.lacks_result(True, 60.2 + goals.ASK_AGAIN_S)
    assert relayed.lacks_result(True, 60.2 + 2 * goals.ASK_AGAIN_S)


def test_sentences_name_the_action_and_the_remedy() -> None:
    assert 'correct the parameter controller_action' in goals.without_controller(ACTION).sentence
    for outcome in (goals.rejected(ACTION), goals.lost(ACTION, 'has ended')):
        assert f'the controller of {ACTION} has ' in outcome.sentence
    assert goals.failed(ValueError('odd')).sentence == (
        'serve: failed with ValueError: odd; see its log.'
    )
