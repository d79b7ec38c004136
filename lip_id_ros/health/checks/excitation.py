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
MOST_REST = 0.5
AT_REST = 0.02


def still(evidence: Evidence) -> Iterator[Found]:
    """Find joints that do not move."""
    for joint, name, _ in _joints(evidence):
        if not evidence.moves(joint):
            yield name, f'{name} does not move'


def little_range(evidence: Evidence) -> Iterator[Found]:
    """Find joints that cover little of their range."""
    for joint, name, kind in _joints(evidence):
        if evidence.moves(joint) and evidence.reach[joint] < LEAST_RANGE[kind]:
            yield name, f'{name} moves over {evidence.reach[joint]:.2g} {UNITS[kind]} only'


def slow(evidence: Evidence) -> Iterator[Found]:
    """Find joints that move slowly."""
    for joint, name, kind in _joints(evidence):
        if evidence.moves(joint) and evidence.speed[joint] < LEAST_SPEED[kind]:
            yield name, (
                f'{name} moves with {evidence.speed[joint]:.2g} {UNITS[kind]}/s (root mean square)'
            )


def gentle(evidence: Evidence) -> Iterator[Found]:
    """Find joints that hardly accelerate."""
    for joint, name, kind in _joints(evidence):
        high = evidence.acceleration[joint]
        if evidence.moves(joint) and high < LEAST_ACCELERATION[kind]:
            yield name, f'{name} accelerates with {high:.2g} {UNITS[kind]}/s^2 at the most'


def one_way(evidence: Evidence) -> Iterator[Found]:
    """Find joints that move in one direction."""
    for joint, name, _ in _joints(evidence):
        if not evidence.moves(joint):
            continue
        velocity = evidence.motion.joined('velocity')[:, joint]
        forward, backward = np.maximum(velocity, 0.0).sum(), np.maximum(-velocity, 0.0).sum()
        if min(forward, backward) < LEAST_RETURN * (forward + backward):
            yield name, f'{name} moves in one direction only'


def together(evidence: Evidence) -> Iterator[Found]:
    """Find pairs of joints whose velocities are proportional."""
    moving = [joint for joint, _, _ in _joints(evidence) if evidence.moves(joint)]
    if len(moving) < 2:
        return
    correlation = np.corrcoef(evidence.motion.joined('velocity')[:, moving].T)
    for first, second in zip(*np.nonzero(np.triu(np.abs(correlation), 1) > TOGETHER), strict=True):
        name, other = evidence.names[moving[first]], evidence.names[moving[second]]
        yield other, f'{other} moves in step with {name}'


def resting(evidence: Evidence) -> Iterator[Found]:
    """Find recordings in which the arm rests most of the time."""
    if not evidence.motion.stretches or not np.any(evidence.speed > 0.0):
        return
    moving = evidence.speed > 0.0
    velocity = np.abs(evidence.motion.joined('velocity')[:, moving])
    rest = float((velocity < AT_REST * evidence.speed[moving]).all(axis=1).mean())
    if rest > MOST_REST:
        yield '', f'the arm rests in {100 * rest:.2g} % of the recording'


def _joints(evidence: Evidence) -> Iterator[tuple[int, str, str]]:
    if evidence.motion.stretches:
        yield from (
            (joint, name, kind)
            for joint, (name, kind) in enumerate(
                zip(evidence.names, evidence.joint_types, strict=True)
            )
        )
