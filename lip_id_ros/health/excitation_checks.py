"""Whether joints moved enough, each in its own way, and are named in the order of the arm."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import re

import numpy as np

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import check, JointText, Severity

LEAST_RANGE = {'revolute': 0.3, 'prismatic': 0.05}
LEAST_SPEED = {'revolute': 0.05, 'prismatic': 0.005}
LEAST_ACCELERATION = {'revolute': 0.5, 'prismatic': 0.05}
UNITS = {'revolute': 'rad', 'prismatic': 'm'}
LEAST_RETURN = 0.1
TOGETHER = 0.97
LEAST_SAMPLES = 100
MOST_RANGE = 10.0 * np.pi
MOST_REST = 0.5
AT_REST = 0.02

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


@check(
    'position_unit',
    Severity.WARNING,
    'A revolute joint turns by more than five turns.',
    'see whether positions are in degrees, and publish them in rad',
)
def far(evidence: Evidence) -> Iterator[JointText]:
    """Find revolute joints that turn by more than five turns."""
    for joint, (name, kind) in enumerate(zip(evidence.names, evidence.joint_types, strict=True)):
        if kind == 'revolute' and evidence.reach[joint] > MOST_RANGE:
            yield (name, f'{name} turns by {evidence.reach[joint]:.3g} rad')


@check(
    'still',
    Severity.WARNING,
    'A joint does not move.',
    'move it, or leave it out by recording.joints if it never will',
)
def still(evidence: Evidence) -> Iterator[JointText]:
    """Find joints that do not move."""
    for joint, name, _ in _joints(evidence):
        if not evidence.moves(joint):
            yield (name, f'{name} does not move')


@check(
    'little_range',
    Severity.WARNING,
    'A joint moves over less than 0.3 rad or 0.05 m.',
    'move it over the range that will be used, since the model knows only that',
)
def little_range(evidence: Evidence) -> Iterator[JointText]:
    """Find joints that cover little of their range."""
    for joint, name, kind in _joints(evidence):
        if evidence.moves(joint) and evidence.reach[joint] < LEAST_RANGE[kind]:
            yield (name, f'{name} moves over {evidence.reach[joint]:.2g} {UNITS[kind]} only')


@check(
    'slow',
    Severity.WARNING,
    'The root mean square velocity of a joint is below 0.05 rad/s or 0.005 m/s.',
    'move it faster, or its viscous and Coulomb friction cannot be separated',
)
def slow(evidence: Evidence) -> Iterator[JointText]:
    """Find joints that move slowly."""
    for joint, name, kind in _joints(evidence):
        if evidence.moves(joint) and evidence.speed[joint] < LEAST_SPEED[kind]:
            yield (
                name,
                f'the root mean square velocity of {name} is {evidence.speed[joint]:.2g} '
                f'{UNITS[kind]}/s',
            )


@check(
    'gentle',
    Severity.NOTE,
    'The acceleration of a joint exceeds 0.5 rad/s^2 or 0.05 m/s^2 in less than a hundredth '
    'of the samples.',
    'accelerate more, or its inertia is not identified (slow motions are not harmed)',
)
def gentle(evidence: Evidence) -> Iterator[JointText]:
    """Find joints that hardly accelerate."""
    for joint, name, kind in _joints(evidence):
        high = evidence.acceleration[joint]
        if evidence.moves(joint) and high < LEAST_ACCELERATION[kind]:
            yield (name, f'{name} accelerates with {high:.2g} {UNITS[kind]}/s^2 at the most')


@check(
    'one_way',
    Severity.WARNING,
    'Less than a tenth of the way of a joint goes in the other direction.',
    'move it back and forth, or Coulomb friction and gravity cannot be separated',
)
def one_way(evidence: Evidence) -> Iterator[JointText]:
    """Find joints that move in one direction."""
    for joint, name, _ in _joints(evidence):
        if not evidence.moves(joint):
            continue
        velocity = evidence.motion.joined('velocity')[:, joint]
        forward, backward = np.maximum(velocity, 0.0).sum(), np.maximum(-velocity, 0.0).sum()
        if min(forward, backward) < LEAST_RETURN * (forward + backward):
            yield (name, f'{name} moves in one direction only')


@check(
    'together',
    Severity.WARNING,
    'The velocities of two joints correlate by more than 0.97.',
    'give each joint a motion of its own, or their shares cannot be separated',
)
def together(evidence: Evidence) -> Iterator[JointText]:
    """Find joints whose velocity is proportional to that of one before."""
    moving = [joint for joint, _, _ in _joints(evidence) if evidence.moves(joint)]
    if len(moving) < 2:
        return
    velocity = evidence.motion.joined('velocity')[:, moving]
    if len(velocity) < LEAST_SAMPLES:
        return
    correlation = np.atleast_2d(np.corrcoef(velocity, rowvar=False))
    for number, joint in enumerate(moving):
        alike = np.flatnonzero(np.abs(correlation[number, :number]) > TOGETHER)
        if alike.size:
            name, other = evidence.names[joint], evidence.names[moving[alike[0]]]
            yield (name, f'{name} moves in step with {other}')


@check(
    'resting',
    Severity.NOTE,
    'All joints rest in more than half of the recording.',
    'record while the arm moves',
)
def resting(evidence: Evidence) -> Iterator[JointText]:
    """Find recordings in which the arm rests most of the time."""
    if not evidence.motion.stretches or not np.any(evidence.speed > 0.0):
        return
    moving = evidence.speed > 0.0
    velocity = np.abs(evidence.motion.joined('velocity')[:, moving])
    rest = float((velocity < AT_REST * evidence.speed[moving]).all(axis=1).mean())
    if rest > MOST_REST:
        yield ('', f'the arm rests in {100 * rest:.2g} % of the recording')


def _joints(evidence: Evidence) -> Iterator[tuple[int, str, str]]:
    if evidence.motion.stretches:
        yield from (
            (joint, name, kind)
            for joint, (name, kind) in enumerate(
                zip(evidence.names, evidence.joint_types, strict=True)
            )
        )


@check(
    'joint_order',
    Severity.WARNING,
    'Names suggest another order than from base to tip: wrist before elbow, 10 before 2.',
    'name the joints from base to tip in recording.joints',
)
def order(evidence: Evidence) -> Iterator[JointText]:
    """Find names whose parts of an arm, or whose numbers, do not go from base to tip."""
    names = evidence.names
    for pair in (_misplaced(names), _miscounted(names)):
        if pair is not None:
            alphabetical = ' (the order is alphabetical)' if list(names) == sorted(names) else ''
            yield ('', f'joint {pair[0]} comes before {pair[1]}{alphabetical}')
            return


@check(
    'gripper_joint',
    Severity.NOTE,
    'By its name a joint belongs to a gripper.',
    'leave it out by recording.joints unless it is to be identified',
)
def gripper(evidence: Evidence) -> Iterator[JointText]:
    """Find joints that by their name belong to a gripper."""
    for name in evidence.names:
        if any(word in TIP for word in _words(name)):
            yield (name, f'{name} seems to be part of a gripper')


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
