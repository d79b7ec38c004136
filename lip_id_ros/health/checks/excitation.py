"""Whether joints moved enough, and each in its own way, to be identified."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import Found

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


def far(evidence: Evidence) -> Iterator[Found]:
    """Find revolute joints that turn by more than five turns."""
    for joint, (name, kind) in enumerate(zip(evidence.names, evidence.joint_types, strict=True)):
        if kind == 'revolute' and evidence.reach[joint] > MOST_RANGE:
            yield Found(name, f'{name} turns by {evidence.reach[joint]:.3g} rad')


def still(evidence: Evidence) -> Iterator[Found]:
    """Find joints that do not move."""
    for joint, name, _ in _joints(evidence):
        if not evidence.moves(joint):
            yield Found(name, f'{name} does not move')


def little_range(evidence: Evidence) -> Iterator[Found]:
    """Find joints that cover little of their range."""
    for joint, name, kind in _joints(evidence):
        if evidence.moves(joint) and evidence.reach[joint] < LEAST_RANGE[kind]:
            yield Found(name, f'{name} moves over {evidence.reach[joint]:.2g} {UNITS[kind]} only')


def slow(evidence: Evidence) -> Iterator[Found]:
    """Find joints that move slowly."""
    for joint, name, kind in _joints(evidence):
        if evidence.moves(joint) and evidence.speed[joint] < LEAST_SPEED[kind]:
            yield Found(
                name,
                f'the root mean square velocity of {name} is {evidence.speed[joint]:.2g} '
                f'{UNITS[kind]}/s',
            )


def gentle(evidence: Evidence) -> Iterator[Found]:
    """Find joints that hardly accelerate."""
    for joint, name, kind in _joints(evidence):
        high = evidence.acceleration[joint]
        if evidence.moves(joint) and high < LEAST_ACCELERATION[kind]:
            yield Found(name, f'{name} accelerates with {high:.2g} {UNITS[kind]}/s^2 at the most')


def one_way(evidence: Evidence) -> Iterator[Found]:
    """Find joints that move in one direction."""
    for joint, name, _ in _joints(evidence):
        if not evidence.moves(joint):
            continue
        velocity = evidence.motion.joined('velocity')[:, joint]
        forward, backward = np.maximum(velocity, 0.0).sum(), np.maximum(-velocity, 0.0).sum()
        if min(forward, backward) < LEAST_RETURN * (forward + backward):
            yield Found(name, f'{name} moves in one direction only')


def together(evidence: Evidence) -> Iterator[Found]:
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
            yield Found(name, f'{name} moves in step with {other}')


def resting(evidence: Evidence) -> Iterator[Found]:
    """Find recordings in which the arm rests most of the time."""
    if not evidence.motion.stretches or not np.any(evidence.speed > 0.0):
        return
    moving = evidence.speed > 0.0
    velocity = np.abs(evidence.motion.joined('velocity')[:, moving])
    rest = float((velocity < AT_REST * evidence.speed[moving]).all(axis=1).mean())
    if rest > MOST_REST:
        yield Found('', f'the arm rests in {100 * rest:.2g} % of the recording')


def _joints(evidence: Evidence) -> Iterator[tuple[int, str, str]]:
    if evidence.motion.stretches:
        yield from (
            (joint, name, kind)
            for joint, (name, kind) in enumerate(
                zip(evidence.names, evidence.joint_types, strict=True)
            )
        )
