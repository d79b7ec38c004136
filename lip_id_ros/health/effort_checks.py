"""Efforts against the motion, and what they may be instead of torques."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.effort_regression import EffortRegression
from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import check, JointText, Severity
from lip_id_ros.health.signal_checks import clipped_share

SMALL = 5.0
HUGE = 5000.0
TURNED = -0.7
FRICTION_SHOWS = 1.8
LEAST_EXPLAINED = 0.15
LEAST_LAG_S = 0.012
LEAST_LAG_SAMPLES = 1.0
LEAST_LAG_GAIN = 0.15


@check(
    'effort_missing',
    Severity.ERROR,
    'No efforts were recorded.',
    'record them with a driver that measures torque or current',
)
def missing(evidence: Evidence) -> Iterator[JointText]:
    """Find recordings without efforts."""
    if evidence.samples.n_samples and not evidence.samples.has_effort:
        yield ('', 'no efforts were recorded')


@check(
    'effort_constant',
    Severity.ERROR,
    'An effort never changes.',
    'let the driver publish it, or leave the joint out by recording.joints',
)
def constant(evidence: Evidence) -> Iterator[JointText]:
    """Find efforts that never change."""
    for joint, name, effort in _efforts(evidence):
        if effort.size > 1 and np.ptp(effort) == 0.0:
            moves = ', although the joint moves' if evidence.moves(joint) else ''
            yield (name, f'the effort of {name} is {effort[0]:g} throughout{moves}')


@check(
    'effort_clipped',
    Severity.WARNING,
    'At least 0.5 % of the samples lie on a flat end of the range of an effort.',
    'move more slowly or with less load, since what was cut off cannot be learned',
)
def clipped(evidence: Evidence) -> Iterator[JointText]:
    """Find efforts with flat ends of their range."""
    for _, name, effort in _efforts(evidence):
        share = clipped_share(effort)
        if share:
            yield (
                name,
                f'the effort of {name} stays at an end of its range ({effort.min():.3g} to '
                f'{effort.max():.3g}) in {100 * share:.2g} % of the samples, as if it was clipped',
            )


@check(
    'effort_sign',
    Severity.WARNING,
    'The friction in an effort would drive the motion.',
    'see whether gravity has the right sign, and turn the sign by a negative value in '
    'recording.effort_scale',
)
def turned(evidence: Evidence) -> Iterator[JointText]:
    """Find efforts whose friction drives the motion instead of braking it."""
    for joint, name, explanation in _explained(evidence):
        cosine = explanation.friction_cosine[joint]
        if cosine < TURNED and explanation.friction_weight[joint] > FRICTION_SHOWS:
            yield (
                name,
                f'the effort of {name} contains friction that would drive the motion instead of '
                'braking it, as if its sign was turned round',
            )


@check(
    'effort_unrelated',
    Severity.WARNING,
    'The motion explains less than 15 % of the variance of an effort.',
    'see whether it belongs to another joint, or leave the joint out by recording.joints',
)
def unrelated(evidence: Evidence) -> Iterator[JointText]:
    """Find efforts that do not follow the motion."""
    for joint, name, explanation in _explained(evidence):
        share = explanation.explained[joint]
        if share < LEAST_EXPLAINED:
            yield (
                name,
                f'the motion explains {100 * max(0.0, share):.2g} % of the effort of {name}',
            )


@check(
    'effort_delay',
    Severity.WARNING,
    'Efforts fit the motion clearly better when they are shifted in time. Only friction, '
    'gravity and inertia of each joint by itself are asked, so that a delay below one sample '
    'or of an arm without friction may not be seen.',
    'see whether the driver filters one of them, and record both with the same delay',
)
def late(evidence: Evidence) -> Iterator[JointText]:
    """Find efforts that come late or early against the motion, all of them together."""
    explanation = evidence.explanation
    if explanation is None or not explanation.lag_gain > LEAST_LAG_GAIN:
        return
    lag = explanation.lag_s
    if abs(lag) > max(LEAST_LAG_S, LEAST_LAG_SAMPLES / evidence.motion.rate_hz):
        side = 'behind' if lag > 0 else 'ahead of'
        yield (
            '',
            f'the efforts are about {1e3 * abs(lag):.2g} ms {side} the motion (as far as a crude '
            f'model shows: its residual variance falls by {100 * explanation.lag_gain:.2g} %)',
        )


@check(
    'effort_small',
    Severity.NOTE,
    'No effort of the arm exceeds 5.',
    'if it is a motor current or a share of the maximum, give motor constant times gear ratio'
    ' as recording.effort_scale',
)
def small(evidence: Evidence) -> Iterator[JointText]:
    """Find arms of which no effort exceeds 5 N m."""
    largest = max(
        (float(np.abs(effort).max()) for _, _, effort in _efforts(evidence)), default=0.0
    )
    if 0.0 < largest < SMALL and evidence.samples.n_joints > 1:
        yield ('', f'no effort exceeds {largest:.3g}, which is little for torques of an arm')


@check(
    'effort_huge',
    Severity.WARNING,
    'An effort exceeds 5000.',
    'give the factor to N m as recording.effort_scale',
)
def huge(evidence: Evidence) -> Iterator[JointText]:
    """Find efforts that no joint of an arm bears."""
    for _, name, effort in _efforts(evidence):
        largest = float(np.abs(effort).max(initial=0.0))
        if largest > HUGE:
            yield (name, f'the effort of {name} reaches {largest:.3g}, which is no torque in N m')


def _efforts(evidence: Evidence) -> Iterator[tuple[int, str, Array]]:
    if evidence.samples.has_effort and evidence.samples.n_samples:
        yield from evidence.columns('effort')


def _explained(evidence: Evidence) -> Iterator[tuple[int, str, EffortRegression]]:
    explanation = evidence.explanation
    if explanation is None:
        return
    for joint, name in enumerate(evidence.names):
        if evidence.moves(joint) and evidence.varies['effort'][joint]:
            yield joint, name, explanation
