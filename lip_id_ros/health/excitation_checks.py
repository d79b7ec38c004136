"""Checks of the excitation: range and speed of each joint, and the order of the joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import re

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.effort_regressions import LEAST_VARIATION, SIGN_WIDTH
from lip_id_ros.health.evidence import Evidence, Joint, STILL
from lip_id_ros.health.finding import check, joint_check, JointText, Severity
from lip_id_ros.health.motion import SmoothMotion
from lip_id_ros.joint_types import PRISMATIC, REVOLUTE
from lip_id_ros.preprocessing.continuity import MOST_TURNS, TURN

LEAST_RANGE = {REVOLUTE: 0.3, PRISMATIC: 0.05}
LEAST_SPEED = {REVOLUTE: 0.05, PRISMATIC: 0.005}
LEAST_ACCELERATION = {REVOLUTE: 0.5, PRISMATIC: 0.05}
LEAST_RETURN = 0.1
TOGETHER = 0.97
LEAST_SAMPLES = 100
MOST_RANGE = {REVOLUTE: MOST_TURNS * TURN, PRISMATIC: 20.0}
MOST_LEFT = 0.6
"""Of the left-out efforts, if positions are read as degrees, over what is left as recorded."""
DEGREE = np.pi / 180.0
FOLDS, RIDGE = 6, 1e-4
"""Of the comparison of degrees with radians."""
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
NO_ARM = ('gripper', 'finger', 'knuckle', 'jaw', 'wheel', 'caster', 'head')


@joint_check(
    'position_unit',
    Severity.WARNING,
    'see whether positions are in degrees or mm, and publish them in rad and m',
)
def position_unit(joint: Joint) -> Iterator[str]:
    """A revolute joint turns by more than five turns, or a prismatic one moves by over 20 m."""
    if joint.reach > MOST_RANGE[joint.kind]:
        yield f'{joint.name} moves by {joint.reach:.3g} {joint.unit}'


@check('position_degrees', Severity.ERROR, 'publish them in rad')
def position_degrees(evidence: Evidence) -> Iterator[JointText]:
    """Most joints turn by over a turn, and efforts follow positions far better as degrees."""
    far = [joint.reach > TURN for joint in evidence.joints if joint.kind == REVOLUTE]
    if evidence.explanation is None or 2 * sum(far) <= len(far):
        return
    left = left_by_degrees(evidence.motion)
    if left < MOST_LEFT:
        yield (
            '',
            'positions seem to be in degrees: read so, they leave '
            f'{100 * left:.2g} % of what they leave of the efforts as rad',
        )


@joint_check(
    'still', Severity.WARNING, 'move it, or leave it out by recording.joints if it never will'
)
def still(joint: Joint) -> Iterator[str]:
    """A joint does not move."""
    if joint.speed <= STILL:
        yield f'{joint.name} does not move'


@joint_check(
    'little_range',
    Severity.WARNING,
    'move it over the range that will be used, since the model knows only that',
)
def little_range(joint: Joint) -> Iterator[str]:
    """A joint moves over less than 0.3 rad or 0.05 m."""
    if joint.moves and joint.reach < LEAST_RANGE[joint.kind]:
        yield f'{joint.name} moves over {joint.reach:.2g} {joint.unit} only'


@joint_check(
    'slow',
    Severity.WARNING,
    'move it faster, or its viscous and Coulomb friction cannot be separated',
)
def slow(joint: Joint) -> Iterator[str]:
    """The root mean square velocity of a joint is below 0.05 rad/s or 0.005 m/s."""
    if joint.moves and joint.speed < LEAST_SPEED[joint.kind]:
        speed = f'{joint.speed:.2g} {joint.unit}/s'
        yield f'the root mean square velocity of {joint.name} is {speed}'


@joint_check(
    'gentle',
    Severity.NOTE,
    'accelerate more, or its inertia is not identified (slow motion is predicted all the same)',
)
def gentle(joint: Joint) -> Iterator[str]:
    """An acceleration stays below 0.5 rad/s^2 or 0.05 m/s^2 in 99 % of the samples."""
    if joint.moves and joint.acceleration < LEAST_ACCELERATION[joint.kind]:
        high = f'{joint.acceleration:.2g} {joint.unit}/s^2'
        yield f'the acceleration of {joint.name} stays below {high} in 99 % of the samples'


@joint_check(
    'one_way',
    Severity.WARNING,
    'move it back and forth, or Coulomb friction and gravity cannot be separated',
)
def one_way(joint: Joint) -> Iterator[str]:
    """Less than a tenth of the way of a joint goes in the other direction."""
    forward = float(np.maximum(joint.smooth_velocity, 0.0).sum())
    backward = float(np.maximum(-joint.smooth_velocity, 0.0).sum())
    if joint.moves and min(forward, backward) < LEAST_RETURN * (forward + backward):
        yield f'{joint.name} moves in one direction only'


@check(
    'together',
    Severity.WARNING,
    'give each joint a motion of its own, or their shares cannot be separated',
)
def together(evidence: Evidence) -> Iterator[JointText]:
    """The velocities of two joints correlate by more than 0.97."""
    moving = [joint for joint in evidence.joints if joint.moves]
    if len(moving) < 2 or moving[0].smooth_velocity.size < LEAST_SAMPLES:
        return
    correlation = np.corrcoef([joint.smooth_velocity for joint in moving])
    for number, joint in enumerate(moving):
        alike = np.flatnonzero(np.abs(correlation[number, :number]) > TOGETHER)
        if alike.size:
            yield joint.name, f'{joint.name} moves in step with {moving[alike[0]].name}'


@check('resting', Severity.NOTE, 'record while the arm moves')
def resting(evidence: Evidence) -> Iterator[JointText]:
    """All joints rest in more than half of the recording."""
    rests = [
        np.abs(joint.smooth_velocity) < AT_REST * joint.speed
        for joint in evidence.joints
        if joint.speed > 0.0
    ]
    rest = float(np.logical_and.reduce(rests).mean()) if rests else 0.0
    if rest > MOST_REST:
        yield '', f'the arm rests in {100 * rest:.2g} % of the recording'


@check('joint_order', Severity.WARNING, 'name the joints from base to tip in recording.joints')
def joint_order(evidence: Evidence) -> Iterator[JointText]:
    """Names suggest another order than from base to tip: wrist before elbow, 10 before 2."""
    names = evidence.names
    pair = _misplaced(names) or _miscounted(names)
    if pair is not None:
        alphabetical = ' (the order is alphabetical)' if list(names) == sorted(names) else ''
        yield '', f'joint {pair[0]} comes before {pair[1]}{alphabetical}'


@check(
    'two_arms',
    Severity.WARNING,
    'name the joints of one arm, from base to tip, in recording.joints',
)
def two_arms(evidence: Evidence) -> Iterator[JointText]:
    """Two or more joints of a left side have the names of joints of a right side."""
    names = [name for name in evidence.names if not _is_no_arm(name)]
    stems = {side: {_stem(name) for name in names if _side(name) == side} for side in 'lr'}
    pairs = len(stems['l'] & stems['r'])
    if pairs > 1:
        yield '', f'{pairs} joints of a left arm are joints of a right arm too'


@joint_check(
    'gripper_joint',
    Severity.WARNING,
    'leave it out by recording.joints unless it is to be identified',
)
def gripper_joint(joint: Joint) -> Iterator[str]:
    """By its name a joint belongs to a gripper, a wheel, a caster or a head."""
    if _is_no_arm(joint.name):
        yield f'{joint.name} seems to be no joint of an arm'


def _is_no_arm(name: str) -> bool:
    return any(word in NO_ARM for word in _words(name))


def _stem(name: str) -> str:
    words = re.findall(r'[a-z]+|\d+', _lower(name))
    return ' '.join(word for word in words if word not in SIDES)


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
    return re.findall(r'[a-z]+', _lower(name))


def _lower(name: str) -> str:
    return re.sub(r'([a-z])([A-Z])', r'\1_\2', name).lower()


def left_by_degrees(motion: SmoothMotion) -> float:
    """Return the mean squares of left-out efforts with positions in degrees over those in rad."""
    position, velocity, acceleration, effort = (
        motion.joined(name) for name in ('position', 'velocity', 'acceleration', 'effort')
    )
    effort = effort[:, effort.std(axis=0) > LEAST_VARIATION]
    speed = np.maximum(velocity.std(axis=0), LEAST_VARIATION)
    others = [acceleration, velocity, np.tanh(velocity / (SIGN_WIDTH * speed))]
    angles = (position, DEGREE * position)
    recorded, read = (
        _left_out(np.hstack([np.sin(each), np.cos(each), *others]), effort) for each in angles
    )
    return float(np.exp(np.mean(np.log(read / recorded))))


def _left_out(terms: Array, effort: Array) -> Array:
    """Return mean squares of efforts that are predicted from the other folds, at most 1, (n,)."""
    terms = (terms - terms.mean(axis=0)) / np.maximum(terms.std(axis=0), LEAST_VARIATION)
    terms = np.column_stack([np.ones(len(terms)), terms])
    effort = (effort - effort.mean(axis=0)) / effort.std(axis=0)
    residuals = []
    for fold in np.array_split(np.arange(len(terms)), FOLDS):
        rest, values = np.delete(terms, fold, axis=0), np.delete(effort, fold, axis=0)
        normal = rest.T @ rest + RIDGE * len(rest) * np.eye(terms.shape[1])
        residuals.append(effort[fold] - terms[fold] @ np.linalg.solve(normal, rest.T @ values))
    return np.minimum(np.mean(np.square(np.concatenate(residuals)), axis=0), 1.0)
