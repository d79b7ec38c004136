"""Goals of `serve`: all are counted, and sentences name the action and the remedy."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lip_id_ros.feedforward import goals
from lip_id_ros.feedforward.goals import Ending, ErrorCode, GoalCounts, Outcome
from lip_id_ros.signals.joints import Refusal

ACTION = '/arm_controller/follow_joint_trajectory'
OUTCOMES = [
    Outcome(Ending.SUCCEEDED, ErrorCode.SUCCESSFUL, ''),
    Outcome(Ending.CANCELED, ErrorCode.INVALID_GOAL, 'preempted'),
    goals.rejected(ACTION),
    goals.lost(ACTION, 'is gone'),
    goals.released(),
]


@given(st.lists(st.sampled_from([*OUTCOMES, None, Refusal.MISSING_JOINT])))
def test_the_counts_add_up(ends: list[Outcome | Refusal | None]) -> None:
    counts = GoalCounts()
    for end in ends:
        counts.received += 1
        if isinstance(end, Refusal):
            counts.refused[end.value] += 1
        elif end is not None:
            counts.end(end)
    values = counts.values()
    assert values['running'] == ends.count(None)
    assert values['received'] == values['running'] + sum(values['refused'].values()) + sum(
        values[ending] for ending in ('succeeded', 'aborted', 'canceled')
    )


def test_sentences_name_the_action_and_the_remedy() -> None:
    for outcome in (goals.rejected(ACTION), goals.lost(ACTION, 'is gone')):
        assert f'the controller of {ACTION} ' in outcome.sentence
    assert 'asked to cancel the goal until it answers' in OUTCOMES[3].sentence
