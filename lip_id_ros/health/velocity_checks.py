"""Checks of recorded velocities against positions."""

from __future__ import annotations

from collections.abc import Iterator
import math

from lip_id_ros.health.evidence import Evidence, Joint
from lip_id_ros.health.finding import check, joint_check, JointText, Severity
from lip_id_ros.preprocessing.continuity import (
    ALIKE,
    LEAST_SCALE,
    MOST_SCALE,
    PROPORTIONAL,
    UNIT_TOLERANCE,
)

SPEED_UNITS = {
    180.0 / math.pi: 'in degrees per second',
    math.pi / 180.0: 'positions were in degrees',
    30.0 / math.pi: 'in revolutions per minute',
    0.5 / math.pi: 'in revolutions per second',
    1e3: 'in thousandths, or times in ms',
    1e-3: 'in thousands',
}
LEAST_LAG_S = 0.01
LEAST_SPEED = 0.01


@check(
    'velocity_missing',
    Severity.NOTE,
    'nothing needs to be done, positions are differentiated; recorded velocities are often '
    'less noisy',
)
def velocity_missing(evidence: Evidence) -> Iterator[JointText]:
    """No velocities were recorded."""
    if evidence.samples.n_samples and not evidence.samples.has_velocity:
        yield '', 'no velocities were recorded'


@joint_check(
    'velocity_constant',
    Severity.NOTE,
    'nothing needs to be done, the positions of all joints are differentiated instead',
)
def velocity_constant(joint: Joint) -> Iterator[str]:
    """A velocity never changes although the joint moves."""
    if 'velocity' in joint.signals and joint.moves and not joint.varies('velocity'):
        yield (
            f'the velocity of {joint.name} is {joint.signals["velocity"].ends[0]:g} throughout, '
            f'although its position changes by {joint.reach:.3g}'
        )


@joint_check(
    'velocity_sign',
    Severity.WARNING,
    'check which of the two signs fits the effort (positions are differentiated instead)',
)
def velocity_sign(joint: Joint) -> Iterator[str]:
    """A velocity has the other sign than the change of position."""
    if _is_compared(joint) and joint.velocity_correlation < -ALIKE:
        yield f'the velocity of {joint.name} has the other sign than the change of its position'


@joint_check(
    'velocity_scale',
    Severity.WARNING,
    'correct the velocities or the times (positions are differentiated instead)',
)
def velocity_scale(joint: Joint) -> Iterator[str]:
    """A velocity is less than 0.92 or more than 1.08 times the change of position."""
    scale, is_alike = abs(joint.velocity_scale), abs(joint.velocity_correlation) > PROPORTIONAL
    if _is_compared(joint) and is_alike and not LEAST_SCALE <= scale <= MOST_SCALE:
        unit = next((u for k, u in SPEED_UNITS.items() if abs(scale / k - 1) < UNIT_TOLERANCE), '')
        yield (
            f'the velocity of {joint.name} is {scale:.3g} times the change of its position'
            f'{unit and f", as if {unit}"}'
        )


@joint_check(
    'velocity_unlike',
    Severity.WARNING,
    'see whether it belongs to another joint (positions are differentiated instead)',
)
def velocity_unlike(joint: Joint) -> Iterator[str]:
    """A velocity correlates with the change of position by less than 0.7."""
    if _is_compared(joint) and abs(joint.velocity_correlation) <= ALIKE:
        yield (
            f'the velocity of {joint.name} hardly follows the change of its position (correlation '
            f'{joint.velocity_correlation:.2g})'
        )


@joint_check('velocity_delay', Severity.WARNING, 'set preprocessing.velocity to differentiated')
def velocity_delay(joint: Joint) -> Iterator[str]:
    """A velocity is more than 10 ms behind or ahead of the position."""
    lag, is_alike = joint.velocity_lag_s, abs(joint.velocity_correlation) > ALIKE
    if _is_compared(joint) and is_alike and abs(lag) > LEAST_LAG_S:
        side = 'behind' if lag > 0 else 'ahead of'
        yield f'the velocity of {joint.name} is {1e3 * abs(lag):.2g} ms {side} its position'


def _is_compared(joint: Joint) -> bool:
    return joint.speed > LEAST_SPEED and joint.varies('velocity')
