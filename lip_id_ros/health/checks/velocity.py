"""Recorded velocities against the positions."""

from __future__ import annotations

from collections.abc import Iterator
import math

import numpy as np

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import Found

ALIKE = 0.7
PROPORTIONAL = 0.95
LEAST_SCALE, MOST_SCALE = 0.8, 1.25
UNITS = {
    180.0 / math.pi: 'degrees per second',
    30.0 / math.pi: 'revolutions per minute',
    0.5 / math.pi: 'revolutions per second',
    1e3: 'thousandths',
    1e-3: 'thousands',
}
UNIT_TOLERANCE = 0.05
LEAST_LAG_S = 0.01
LEAST_SPEED = 0.01


def missing(evidence: Evidence) -> Iterator[Found]:
    """Find recordings without velocities."""
    if evidence.samples.n_samples and not evidence.samples.has_velocity:
        yield Found('', 'no velocities were recorded')


def constant(evidence: Evidence) -> Iterator[Found]:
    """Find velocities that never change although the joint moves."""
    if not evidence.samples.has_velocity:
        return
    for joint, name in enumerate(evidence.names):
        values = evidence.samples.velocity[:, joint]
        if evidence.moves(joint) and np.ptp(values) == 0.0:
            yield Found(
                name,
                f'the velocity of {name} is {values[0]:g} throughout, although its position '
                f'changes by {evidence.reach[joint]:.3g}',
            )


def turned(evidence: Evidence) -> Iterator[Found]:
    """Find velocities with the other sign than the change of position."""
    for name, _, correlation, _ in _compared(evidence):
        if correlation < -ALIKE:
            yield Found(
                name,
                f'the velocity of {name} has the other sign than the change of its position',
            )


def scaled(evidence: Evidence) -> Iterator[Found]:
    """Find velocities that are a multiple of the change of position."""
    for name, scale, correlation, _ in _compared(evidence):
        if abs(correlation) > PROPORTIONAL and not LEAST_SCALE <= abs(scale) <= MOST_SCALE:
            yield Found(
                name,
                f'the velocity of {name} is {abs(scale):.3g} times the change of its '
                f'position{_unit(abs(scale))}',
            )


def unlike(evidence: Evidence) -> Iterator[Found]:
    """Find velocities that do not follow the change of position."""
    for name, _, correlation, _ in _compared(evidence):
        if abs(correlation) <= ALIKE:
            yield Found(
                name,
                f'the velocity of {name} hardly follows the change of its position (correlation '
                f'{correlation:.2g})',
            )


def late(evidence: Evidence) -> Iterator[Found]:
    """Find velocities that come late or early against the positions."""
    for name, _, correlation, lag in _compared(evidence):
        if abs(correlation) > ALIKE and abs(lag) > LEAST_LAG_S:
            side = 'behind' if lag > 0 else 'ahead of'
            yield Found(
                name, f'the velocity of {name} is {1e3 * abs(lag):.2g} ms {side} its position'
            )


def _compared(evidence: Evidence) -> Iterator[tuple[str, float, float, float]]:
    agreement = evidence.agreement
    if agreement is None:
        return
    for joint, name in enumerate(evidence.names):
        changes = np.ptp(evidence.samples.velocity[:, joint]) > 0.0
        if evidence.speed[joint] > LEAST_SPEED and changes:
            yield (
                name,
                float(agreement.scale[joint]),
                float(agreement.correlation[joint]),
                float(agreement.lag_s[joint]),
            )


def _unit(scale: float) -> str:
    for factor, unit in UNITS.items():
        if abs(scale / factor - 1.0) < UNIT_TOLERANCE:
            return f', as if in {unit}'
    return ''
