"""Checks of recorded efforts: missing, clipped, of wrong sign, delay or unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lip_id_ros.arrays import runs
from lip_id_ros.health.evidence import Evidence, Joint
from lip_id_ros.health.finding import check, joint_check, JointText, Severity
from lip_id_ros.recording.spill import marked

ZERO_S = 1.0
SMALL = 5.0
HUGE = 5000.0
TURNED = -0.7
FRICTION_SHOWS = 1.8
DRIVING, EXCHANGED = -5.5, 4.0
"""Standard errors of responses with a wrong sign, and of two joints' that are exchanged."""
LEAST_EXPLAINED = 0.15
LEAST_LAG_S = 0.012
LEAST_LAG_SAMPLES = 1.0
ALONE = 2.5
"""Least lag of one joint from that of all, in least lags of all."""
LEAST_LAG_GAIN = 0.15
NEAR_ZERO, LEAST_DIPS = 0.01, 3
"""Share of the range of an effort that is near zero, and times at which it gets there."""
LEAST_OWN = 1e-4
"""Share of an effort's variance that another's does not explain where it is no copy."""
LEAST_SAMPLES = 100


@check(
    'effort_missing', Severity.ERROR, 'record them with a driver that measures torque or current'
)
def effort_missing(evidence: Evidence) -> Iterator[JointText]:
    """No efforts were recorded."""
    if evidence.samples.n_samples and not evidence.samples.has_effort:
        yield '', 'no efforts were recorded'


@joint_check(
    'effort_constant',
    Severity.ERROR,
    'let the driver publish it, or leave the joint out by recording.joints',
)
def effort_constant(joint: Joint) -> Iterator[str]:
    """An effort never changes, or by no more than 1e-5 of its size."""
    if 'effort' in joint.signals and joint.t.size > 1 and not joint.varies('effort'):
        effort, moves = joint.signals['effort'], ', although the joint moves' * joint.moves
        value = f'changes by {effort.range:.1g} only'
        if effort.range == 0.0:
            value = f'is {effort.ends[0]:g} throughout'
        yield f'the effort of {joint.name} {value}{moves}'


@check(
    'effort_zero',
    Severity.WARNING,
    'see whether the drives were off or the driver failed, and leave this part of the recording '
    'out',
)
def effort_zero(evidence: Evidence) -> Iterator[JointText]:
    """All efforts are exactly zero for more than a second, and not in the whole recording."""
    samples = evidence.samples
    if not samples.has_effort:
        return
    is_zero = marked(lambda efforts: (efforts == 0.0).all(axis=1), samples.effort)
    first, end = runs(is_zero)
    seconds = samples.t[end - 1] - samples.t[first]
    long = seconds > ZERO_S
    if long.any() and not is_zero.all():
        at = int(np.argmax(seconds))
        yield (
            '',
            f'all efforts are zero for {seconds[long].sum():.3g} s of '
            f'{samples.t[-1] - samples.t[0]:.3g} s, longest for {seconds[at]:.3g} s from '
            f'{samples.t[first[at]]:.4g} s on',
        )


@joint_check(
    'effort_clipped',
    Severity.WARNING,
    'move more slowly or with less load, since what was cut off cannot be learned',
)
def effort_clipped(joint: Joint) -> Iterator[str]:
    """At least 0.5 % of the samples lie on a flat end of the range of an effort, or near one."""
    if joint.varies('effort') and (share := joint.clipped_share):
        low, high = joint.signals['effort'].ends
        yield (
            f'the effort of {joint.name} stays at an end of its range ({low:.3g} to {high:.3g}) '
            f'in {100 * share:.2g} % of the samples, as if it was clipped'
        )


@joint_check(
    'effort_sign',
    Severity.WARNING,
    'compare its sign with that of gravity, and reverse it by a negative value in '
    'recording.effort_scale',
)
def effort_sign(joint: Joint) -> Iterator[str]:
    """The friction in an effort would drive the motion, or inertia be negative."""
    is_turned = joint.friction_cosine < TURNED and joint.friction_weight > FRICTION_SHOWS
    if (is_turned or joint.braking < DRIVING) and joint.moves and joint.varies('effort'):
        yield (
            f'the effort of {joint.name} contains friction or inertia that would drive the motion '
            'instead of braking it, as if its sign were reversed'
        )


@check(
    'effort_exchanged',
    Severity.WARNING,
    'see whether names and efforts of the driver are in one order, and exchange them',
)
def effort_exchanged(evidence: Evidence) -> Iterator[JointText]:
    """The efforts of two joints answer to the motion of each other rather than to their own."""
    if evidence.responses is None:
        return
    squares = sum(np.abs(each.crossed) * each.crossed for each in evidence.responses)
    crossed = np.sqrt(np.maximum(np.triu(squares, 1), 0.0))
    one, other = np.unravel_index(int(np.argmax(crossed)), crossed.shape)
    if crossed[one, other] > EXCHANGED:
        names = f'{evidence.names[one]} and {evidence.names[other]}'
        yield evidence.names[one], f'the efforts of {names} seem to be exchanged'


@joint_check(
    'effort_unrelated',
    Severity.WARNING,
    'see whether it belongs to another joint, or leave the joint out by recording.joints',
)
def effort_unrelated(joint: Joint) -> Iterator[str]:
    """The motion explains less than 15 % of the variance of an effort."""
    share = joint.effort_explained
    if share < LEAST_EXPLAINED and joint.moves and joint.varies('effort'):
        yield f'the motion explains {100 * max(0.0, share):.2g} % of the effort of {joint.name}'


@joint_check(
    'effort_unsigned',
    Severity.ERROR,
    'record efforts with their sign, since it cannot be restored',
)
def effort_unsigned(joint: Joint) -> Iterator[str]:
    """An effort has one sign only, and turns back near zero three times or more."""
    if joint.varies('effort') and joint.moves:
        low, high = joint.signals['effort'].ends
        effort = np.abs(joint.signals['effort'].some_values())
        near = effort < NEAR_ZERO * (high - low)
        if low * high >= 0.0 and runs(near)[0].size >= LEAST_DIPS:
            yield f'the effort of {joint.name} turns back at zero, as if its sign was cut off'


@check(
    'effort_copied',
    Severity.ERROR,
    'correct the driver, or leave one of them out by recording.joints',
)
def effort_copied(evidence: Evidence) -> Iterator[JointText]:
    """The efforts of two joints are the same but for an offset and a scale."""
    joints = [each for each in evidence.joints if each.varies('effort')]
    if len(joints) < 2 or joints[0].t.size < LEAST_SAMPLES:
        return
    alike = np.square(np.corrcoef([each.signals['effort'].some_values() for each in joints]))
    for one, other in np.argwhere(np.triu(alike > 1.0 - LEAST_OWN, 1)):
        name = joints[other].name
        yield name, f'the effort of {name} is that of {joints[one].name}, but for a scale'


@joint_check('effort_held', Severity.WARNING, 'record all efforts at the rate of the positions')
def effort_held(joint: Joint) -> Iterator[str]:
    """The effort of one joint has new values at some samples only, while others change."""
    if joint.effort_period > 1:
        yield f'the effort of {joint.name} is held over {joint.effort_period} samples'


@check(
    'effort_delay',
    Severity.WARNING,
    'see whether the driver filters one of them, and record both with the same delay, or set '
    'recording.effort_delay_s',
)
def effort_delay(evidence: Evidence) -> Iterator[JointText]:
    """
    Efforts of all joints, or of one, fit the motion clearly better when they are shifted in time.

    Judged by friction, gravity and inertia as of an arm, and of a short recording by those of each
    joint by itself, so that a delay below one sample, or of one joint, may not be found.
    """
    if (lags := evidence.lags) is None:
        return
    least_s = max(LEAST_LAG_S, LEAST_LAG_SAMPLES / evidence.motion.rate_hz)
    together_s = 0.0
    if abs(lags.lag_s) > least_s and lags.gain > LEAST_LAG_GAIN:
        together_s = lags.lag_s
        yield '', f'the efforts are {_late(lags.lag_s, lags.gain)}'
    for name, lag_s, gain in zip(evidence.names, lags.joint_lag_s, lags.joint_gain, strict=True):
        if abs(lag_s - together_s) > ALONE * least_s and gain > LEAST_LAG_GAIN:
            yield name, f'the effort of {name} is {_late(lag_s, gain)}'


def _late(lag_s: float, gain: float) -> str:
    side = 'behind' if lag_s > 0 else 'ahead of'
    return (
        f'about {1e3 * abs(lag_s):.2g} ms {side} the motion (by a crude model, whose residual '
        f'variance falls by {100 * gain:.2g} %)'
    )


@check(
    'effort_small',
    Severity.NOTE,
    'if it is a motor current or a share of the maximum, give motor constant times gear ratio'
    ' as recording.effort_scale',
)
def effort_small(evidence: Evidence) -> Iterator[JointText]:
    """No effort of the arm exceeds 5."""
    efforts = [each.signals['effort'] for each in evidence.joints if each.varies('effort')]
    largest = max((effort.largest for effort in efforts), default=0.0)
    if 0.0 < largest < SMALL and len(efforts) > 1:
        yield '', f'no effort exceeds {largest:.3g}, which is little for torques of an arm'


@joint_check('effort_huge', Severity.WARNING, 'give the factor to N m as recording.effort_scale')
def effort_huge(joint: Joint) -> Iterator[str]:
    """An effort exceeds 5000."""
    if 'effort' in joint.signals and (largest := joint.signals['effort'].largest) > HUGE:
        yield f'the effort of {joint.name} reaches {largest:.3g}, which is no torque in N m'
