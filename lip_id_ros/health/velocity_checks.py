"""Recorded velocities against the positions."""

from __future__ import annotations

from collections.abc import Iterator
import math

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import check, JointText, Severity

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


@check(
    'velocity_missing',
    Severity.NOTE,
    'No velocities were recorded.',
    'nothing needs to be done, positions are differentiated; recorded velocities are often '
    'less noisy',
)
def missing(evidence: Evidence) -> Iterator[JointText]:
    """Find recordings without velocities."""
    if evidence.samples.n_samples and not evidence.samples.has_velocity:
        yield ('', 'no velocities were recorded')


@check(
    'velocity_constant',
    Severity.WARNING,
    'A velocity never changes although the joint moves.',
    'set preprocessing.velocity to differentiated',
)
def constant(evidence: Evidence) -> Iterator[JointText]:
    """Find velocities that never change although the joint moves."""
    if not evidence.samples.has_velocity:
        return
    for joint, name in enumerate(evidence.names):
        if evidence.moves(joint) and not evidence.varies['velocity'][joint]:
            yield (
                name,
                f'the velocity of {name} is {evidence.samples.velocity[0, joint]:g} throughout, '
                f'although its position changes by {evidence.reach[joint]:.3g}',
            )


@check(
    'velocity_sign',
    Severity.WARNING,
    'A velocity has the other sign than the change of position.',
    'set preprocessing.velocity to differentiated, and ask which of the two signs the effort has',
)
def turned(evidence: Evidence) -> Iterator[JointText]:
    """Find velocities with the other sign than the change of position."""
    for name, _, correlation, _ in _compared(evidence):
        if correlation < -ALIKE:
            yield (
                name,
                f'the velocity of {name} has the other sign than the change of its position',
            )


@check(
    'velocity_scale',
    Severity.WARNING,
    'A velocity is less than 0.8 or more than 1.25 times the change of position.',
    'correct the unit in the driver, or set preprocessing.velocity to differentiated',
)
def scaled(evidence: Evidence) -> Iterator[JointText]:
    """Find velocities that are a multiple of the change of position."""
    for name, scale, correlation, _ in _compared(evidence):
        if abs(correlation) > PROPORTIONAL and not LEAST_SCALE <= abs(scale) <= MOST_SCALE:
            yield (
                name,
                f'the velocity of {name} is {abs(scale):.3g} times the change of its '
                f'position{_unit(abs(scale))}',
            )


@check(
    'velocity_unlike',
    Severity.WARNING,
    'A velocity correlates with the change of position by less than 0.7.',
    'see whether it belongs to another joint, or set preprocessing.velocity to differentiated',
)
def unlike(evidence: Evidence) -> Iterator[JointText]:
    """Find velocities that do not follow the change of position."""
    for name, _, correlation, _ in _compared(evidence):
        if abs(correlation) <= ALIKE:
            yield (
                name,
                f'the velocity of {name} hardly follows the change of its position (correlation '
                f'{correlation:.2g})',
            )


@check(
    'velocity_delay',
    Severity.WARNING,
    'A velocity is more than 10 ms behind or ahead of the position.',
    'set preprocessing.velocity to differentiated',
)
def late(evidence: Evidence) -> Iterator[JointText]:
    """Find velocities that come late or early against the positions."""
    for name, _, correlation, lag in _compared(evidence):
        if abs(correlation) > ALIKE and abs(lag) > LEAST_LAG_S:
            side = 'behind' if lag > 0 else 'ahead of'
            yield (name, f'the velocity of {name} is {1e3 * abs(lag):.2g} ms {side} its position')


def _compared(evidence: Evidence) -> Iterator[tuple[str, float, float, float]]:
    agreement = evidence.agreement
    if agreement is None:
        return
    for joint, name in enumerate(evidence.names):
        if evidence.speed[joint] > LEAST_SPEED and evidence.varies['velocity'][joint]:
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
