"""Joint names that tell of another order than from base to tip."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import re

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import Found

PLACES = (
    ('base', 'waist', 'torso', 'column'),
    ('shoulder',),
    ('elbow',),
    ('forearm',),
    ('wrist',),
    ('hand', 'gripper', 'finger', 'tool'),
)
WITHIN_SHOULDER = (('pan', 'yaw', 'rotation'), ('lift', 'pitch'))
SIDES = ('left', 'right', 'l', 'r')
TIP = ('gripper', 'finger')


def order(evidence: Evidence) -> Iterator[Found]:
    """Find names whose parts of an arm, or whose numbers, do not go from base to tip."""
    names = evidence.names
    for pair in (_misplaced(names), _miscounted(names)):
        if pair is not None:
            alphabetical = ' (the order is alphabetical)' if list(names) == sorted(names) else ''
            yield Found('', f'joint {pair[0]} comes before {pair[1]}{alphabetical}')
            return


def gripper(evidence: Evidence) -> Iterator[Found]:
    """Find joints that by their name belong to a gripper."""
    for name in evidence.names:
        if any(word in TIP for word in _words(name)):
            yield Found(name, f'{name} seems to be part of a gripper')


def _misplaced(names: Sequence[str]) -> tuple[str, str] | None:
    placed = [(_side(name), place, name) for name in names if (place := _place(name)) is not None]
    for number, (side, place, name) in enumerate(placed):
        for other_side, other_place, other in placed[number + 1 :]:
            if side == other_side and place > other_place:
                return name, other
    return None


def _miscounted(names: Sequence[str]) -> tuple[str, str] | None:
    last: dict[str, tuple[int, str]] = {}
    for name in names:
        match = re.search(r'\d+(?=\D*$)', name)
        if match is None:
            continue
        stem = name[: match.start()] + '#' + name[match.end() :]
        number, before = last.get(stem, (-1, ''))
        if int(match.group()) < number:
            return before, name
        last[stem] = (int(match.group()), name)
    return None


def _place(name: str) -> tuple[int, int] | None:
    words = _words(name)
    for place, parts in enumerate(PLACES):
        if any(word in parts for word in words):
            return place, _turn(words) if 'shoulder' in words else 0
    return None


def _turn(words: Sequence[str]) -> int:
    return next((n for n, turns in enumerate(WITHIN_SHOULDER) if set(words) & set(turns)), 0)


def _side(name: str) -> str:
    return next((word[0] for word in _words(name) if word in SIDES), '')


def _words(name: str) -> list[str]:
    return re.findall(r'[a-z]+', re.sub(r'([a-z])([A-Z])', r'\1_\2', name).lower())
