"""Efforts against the motion, and what they may be instead of torques."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.explanation import Explanation
from lip_id_ros.health.finding import Found
from lip_id_ros.health.resolution import clipped_share

SMALL = 5.0
HUGE = 5000.0
TURNED = -0.7
FRICTION_SHOWS = 1.8
LEAST_EXPLAINED = 0.15
LEAST_LAG_S = 0.012
LEAST_LAG_SAMPLES = 1.0
LEAST_LAG_GAIN = 0.15


def missing(evidence: Evidence) -> Iterator[Found]:
    """Find recordings without efforts."""
    if evidence.samples.n_samples and not evidence.samples.has_effort:
        yield Found('', 'no efforts were recorded')


def constant(evidence: Evidence) -> Iterator[Found]:
    """Find efforts that never change."""
    for joint, name, effort in _efforts(evidence):
        if effort.size > 1 and np.ptp(effort) == 0.0:
            moves = ', although the joint moves' if evidence.moves(joint) else ''
            yield Found(name, f'the effort of {name} is {effort[0]:g} throughout{moves}')


def clipped(evidence: Evidence) -> Iterator[Found]:
    """Find efforts with flat ends of their range."""
    for _, name, effort in _efforts(evidence):
        share = clipped_share(effort)
        if share:
            yield Found(
                name,
                f'the effort of {name} stays at an end of its range ({effort.min():.3g} to '
                f'{effort.max():.3g}) in {100 * share:.2g} % of the samples, as if it was clipped',
            )


def turned(evidence: Evidence) -> Iterator[Found]:
    """Find efforts whose friction drives the motion instead of braking it."""
    for joint, name, explanation in _explained(evidence):
        cosine = explanation.friction_cosine[joint]
        if cosine < TURNED and explanation.friction_weight[joint] > FRICTION_SHOWS:
            yield Found(
                name,
                f'the effort of {name} contains friction that would drive the motion instead of '
                'braking it, as if its sign was turned round',
            )


def unrelated(evidence: Evidence) -> Iterator[Found]:
    """Find efforts that do not follow the motion."""
    for joint, name, explanation in _explained(evidence):
        share = explanation.explained[joint]
        if share < LEAST_EXPLAINED:
            yield Found(
                name, f'the motion explains {100 * max(0.0, share):.2g} % of the effort of {name}'
            )


def late(evidence: Evidence) -> Iterator[Found]:
    """Find efforts that come late or early against the motion, all of them together."""
    explanation = evidence.explanation
    if explanation is None or not explanation.lag_gain > LEAST_LAG_GAIN:
        return
    lag = explanation.lag_s
    if abs(lag) > max(LEAST_LAG_S, LEAST_LAG_SAMPLES / evidence.motion.rate_hz):
        side = 'behind' if lag > 0 else 'ahead of'
        yield Found(
            '',
            f'the efforts are about {1e3 * abs(lag):.2g} ms {side} the motion (as far as a crude '
            f'model can tell: what it leaves over falls by {100 * explanation.lag_gain:.2g} %)',
        )


def small(evidence: Evidence) -> Iterator[Found]:
    """Find arms of which no effort exceeds 5 N m."""
    if not evidence.samples.has_effort or evidence.samples.n_samples == 0:
        return
    largest = float(np.abs(evidence.samples.effort).max())
    if 0.0 < largest < SMALL and evidence.samples.n_joints > 1:
        yield Found('', f'no effort exceeds {largest:.3g}, which is little for torques of an arm')


def huge(evidence: Evidence) -> Iterator[Found]:
    """Find efforts that no joint of an arm bears."""
    for _, name, effort in _efforts(evidence):
        largest = float(np.abs(effort).max(initial=0.0))
        if largest > HUGE:
            yield Found(
                name, f'the effort of {name} reaches {largest:.3g}, which is no torque in N m'
            )


def _efforts(
    evidence: Evidence,
) -> Iterator[tuple[int, str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]]:
    if evidence.samples.has_effort and evidence.samples.n_samples:
        for joint, name in enumerate(evidence.names):
            yield joint, name, evidence.samples.effort[:, joint]


def _explained(evidence: Evidence) -> Iterator[tuple[int, str, Explanation]]:
    explanation = evidence.explanation
    if explanation is None:
        return
    for joint, name in enumerate(evidence.names):
        if evidence.moves(joint) and np.ptp(evidence.samples.effort[:, joint]) > 0.0:
            yield joint, name, explanation
