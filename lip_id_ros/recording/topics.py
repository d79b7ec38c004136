"""Which topics of a bag to read joint samples from."""

from __future__ import annotations

from collections.abc import Sequence

from lip_id_ros.errors import SourceError
from lip_id_ros.recording.bags import Bag, Topic
from lip_id_ros.recording.joint_messages import EXTRACTORS, JOINT_STATE

DEFAULT_TOPIC = '/joint_states'


def joint_topics(bag: Bag) -> list[Topic]:
    """Return the topics of a bag that carry joint samples."""
    return [topic for topic in bag.topics if topic.type in EXTRACTORS]


def choose_topics(bag: Bag, wanted: str) -> list[Topic]:
    """
    Return the topics to read joint samples from.

    Those named (separated by commas); else the only one with messages, else /joint_states, else
    the only one of JointState.

    Raises
    ------
    SourceError
        If there is none, or several and no way to choose.

    """
    candidates = joint_topics(bag)
    names = [name.strip() for name in wanted.split(',') if name.strip()]
    if names:
        return [_named_topic(bag, candidates, name) for name in dict.fromkeys(names)]
    if not candidates:
        raise SourceError(
            f'{bag.path} must have a topic of {" or ".join(EXTRACTORS)}, but has '
            f'{_listed(bag.topics)}; record joint_states.'
        )
    filled = [topic for topic in candidates if topic.count] or candidates
    for some in (
        filled,
        [topic for topic in filled if topic.name == DEFAULT_TOPIC],
        [topic for topic in filled if topic.type == JOINT_STATE],
    ):
        if len(some) == 1:
            return some
    raise SourceError(
        f'{bag.path} has several topics with joint samples: {_listed(candidates)}; choose one, '
        'or several separated by commas, with recording.topic.'
    )


def _named_topic(bag: Bag, candidates: Sequence[Topic], wanted: str) -> Topic:
    for topic in candidates:
        if topic.name.lstrip('/') == wanted.lstrip('/'):
            return topic
    raise SourceError(
        f'recording.topic must be a topic of {bag.path} with joint samples, not {wanted!r}; '
        f'it has {_listed(bag.topics)}.'
    )


def _listed(topics: Sequence[Topic]) -> str:
    texts = [f'{topic.name} ({topic.type}, {topic.count} messages)' for topic in topics]
    return ', '.join(texts) or 'no topics'
