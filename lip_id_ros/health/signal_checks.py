"""Checks of stamps and of signals."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.health.evidence import COARSE_EFFORT, Evidence, Joint
from lip_id_ros.health.finding import check, joint_check, JointText, Severity
from lip_id_ros.preprocessing.continuity import (
    BLOCKS,
    MOST_VALUES,
    usual_range,
)
from lip_id_ros.preprocessing.smoothing import longest_step
from lip_id_ros.recording.spill import extent, some_blocks, thinned
from lip_id_ros.recording.timing import gap_starts, GAP_STEPS, median_step, some_steps, WENT_BACK
from lip_id_ros.settings import PreprocessingSettings

SHORT_S = 20.0
LOW_RATE_HZ, STRANGE_RATE_HZ = 20.0, 2.0
MOST_JITTER = 0.2
MOST_DROPPED = 0.01
MOST_STALE = 0.01
MOST_GAPS_PER_MINUTE = 6.0
COARSE = {'position': 0.01, 'velocity': 0.1, 'effort': COARSE_EFFORT}
"""Largest step in standard deviations of the signal."""
FROZEN_S = 1.0
FROZEN_SHARE = 0.2
LEAST_WAY = 0.05
LEAST_RETURN, RETURNED, MOST_RETURNS = 0.02, 0.8, 0.05
"""Way there and back [rad or m], the least share of it that goes back, and share of such steps."""


@check('short', Severity.WARNING, 'record a minute or more')
def short(evidence: Evidence) -> Iterator[JointText]:
    """The recording lasts less than 20 s."""
    t = evidence.samples.t
    duration = float(t[-1] - t[0]) if t.size else 0.0
    if duration < SHORT_S:
        yield '', f'the recording lasts {duration:.3g} s'


@check('low_rate', Severity.WARNING, 'raise the publishing rate, or move slowly enough for it')
def low_rate(evidence: Evidence) -> Iterator[JointText]:
    """Samples come at less than 20 Hz."""
    step = median_step(evidence.samples.t)
    if step > 1.0 / LOW_RATE_HZ:
        unit = ', as if times were not in s' if step > 1.0 / STRANGE_RATE_HZ else ''
        yield '', f'samples come at {1.0 / step:.3g} Hz{unit}'


@check('jitter', Severity.NOTE, 'let the driver stamp the messages when it reads the encoders')
def jitter(evidence: Evidence) -> Iterator[JointText]:
    """Steps between samples scatter by more than a fifth."""
    steps = some_steps(evidence.samples.t)
    if steps.size < 2:
        return
    typical = float(np.median(steps))
    scatter = float(np.std(steps[steps <= GAP_STEPS * typical]))
    if scatter > MOST_JITTER * typical:
        text = f'{1e3 * scatter:.3g} ms around {1e3 * typical:.3g} ms'
        yield '', f'the steps between samples scatter by {text}'


@check(
    'gaps',
    Severity.WARNING,
    "record on the robot's own computer, or set preprocessing.max_gap_s",
)
def gaps(evidence: Evidence) -> Iterator[JointText]:
    """More than six gaps in a minute; motion is cut at each, and its edges are lost."""
    t = evidence.samples.t
    starts = gap_starts(t, longest_step(t, PreprocessingSettings().cutoff))
    if starts.size and starts.size > MOST_GAPS_PER_MINUTE * (t[-1] - t[0]) / 60.0:
        longest = float((t[starts + 1] - t[starts]).max())
        yield '', f'the recording has {starts.size} gaps, the longest of {longest:.3g} s'


@check(
    'clock_back',
    Severity.WARNING,
    'let the clock be set before the recording, or set recording.clock to receive',
)
def clock_back(evidence: Evidence) -> Iterator[JointText]:
    """The clock of the stamps went back; motion is cut there."""
    for note in evidence.samples.notes:
        if note.startswith(WENT_BACK):
            yield '', note


@check(
    'dropped',
    Severity.WARNING,
    'look at the reasons, and choose topic and joints by recording.topic and recording.joints',
)
def dropped(evidence: Evidence) -> Iterator[JointText]:
    """More than one message in a hundred cannot be used."""
    counts = {str(reason): count for reason, count in evidence.samples.counts.items() if count}
    lost = sum(counts.values())
    total = lost + evidence.samples.n_samples
    if lost > MOST_DROPPED * total:
        reasons = ', '.join(f'{reason}: {count}' for reason, count in counts.items())
        yield '', f'{lost} of {total} messages cannot be used ({reasons})'


@check(
    'stale',
    Severity.NOTE,
    'nothing needs to be done, they are left out; better publish no faster than the driver reads',
)
def stale(evidence: Evidence) -> Iterator[JointText]:
    """More than one sample in a hundred repeats the one before under a new stamp."""
    share = evidence.stale_share
    if share > MOST_STALE:
        yield '', f'{100 * share:.2g} % of the samples repeat the one before under a new stamp'


@check(
    'held',
    Severity.NOTE,
    'nothing needs to be done, a fit interpolates between the new values; better publish all '
    'signals at one rate',
)
def held(evidence: Evidence) -> Iterator[JointText]:
    """The positions, velocities or efforts of all joints have new values at some samples only."""
    for name, period in evidence.source_periods.items():
        if period > 1:
            yield (
                '',
                f'each {name} is held over {period} samples (zero-order hold), while other '
                'signals have new values',
            )


@joint_check(
    'outliers',
    Severity.WARNING,
    'see what the driver publishes at these times, and leave this part of the recording out',
)
def outliers(joint: Joint) -> Iterator[str]:
    """
    A few samples lie further from all others than ten times the range of those.

    They are at most one in a hundred.
    """
    for name, signal in joint.signals.items():
        values = signal.some_values()
        if not values.size:
            return
        low, high, reach = usual_range(values)
        if low - reach <= signal.ends[0] and signal.ends[1] <= high + reach:
            continue
        count = signal.count_beyond(low - reach, high + reach)
        yield (
            f'{count} samples of the {name} of {joint.name} are outliers (up to '
            f'{signal.largest:.3g}, where 98 % lie from {low:.3g} to {high:.3g})'
        )


@check(
    'position_jump',
    Severity.WARNING,
    'see what the driver publishes at these times; motion is cut there, and its edges are lost',
)
def position_jump(evidence: Evidence) -> Iterator[JointText]:
    """A position jumps at once by more than 0.05 rad or m, far faster than before and after."""
    rows, position = evidence.jumps, evidence.samples.position
    if rows.size:
        step = position[rows[0]] - position[rows[0] - 1]
        joint = int(np.argmax(np.abs(step)))
        at = f'at {evidence.samples.t[rows[0]]:.4g} s by {step[joint]:.3g}'
        yield '', f'positions jump {rows.size} times, first that of {evidence.names[joint]} {at}'


@check(
    'alternating',
    Severity.ERROR,
    'stop the other publisher, or give the topic of the robot as recording.topic',
)
def alternating(evidence: Evidence) -> Iterator[JointText]:
    """Positions go to another place and back from sample to sample, as from two publishers."""
    samples = evidence.samples
    marks = [
        _returns(samples.position[rows])
        for rows in some_blocks(samples.n_samples, MOST_VALUES, BLOCKS)
    ]
    share = np.concatenate(marks).mean(axis=0) if samples.n_samples > 2 else np.zeros(1)
    if share.max() > MOST_RETURNS:
        joint = evidence.names[int(np.argmax(share))]
        yield '', f'positions alternate between two tracks, most that of {joint}'


def _returns(position: Array) -> BoolArray:
    """Mark the samples (N - 2, n) from which a position goes back to where it came from."""
    there, back = np.diff(position, axis=0)[:-1], np.diff(position, axis=0)[1:]
    way = np.minimum(np.abs(there), np.abs(back))
    return np.asarray((way > LEAST_RETURN) & (np.abs(there + back) < (1.0 - RETURNED) * way))


@joint_check('coarse', Severity.NOTE, 'record it with more digits, or move more')
def coarse(joint: Joint) -> Iterator[str]:
    """
    A signal comes in steps that are large beside its standard deviation.

    That is 1 % for a position, 10 % for a velocity or effort.
    """
    for name, signal in joint.signals.items():
        if joint.moves and signal.coarseness > COARSE[name]:
            yield (
                f'the {name} of {joint.name} comes in steps of {signal.step:.3g}, '
                f'{100 * signal.coarseness:.2g} % of its standard deviation'
            )


@joint_check('frozen', Severity.WARNING, 'leave this part of the recording out')
def frozen(joint: Joint) -> Iterator[str]:
    """
    A velocity or effort does not change for more than a second while the joint moves.

    The joint moves over a fifth of its range meanwhile. Signals that come in steps are not judged.
    """
    t = joint.t
    for name in ('velocity', 'effort'):
        if not joint.varies(name) or joint.signals[name].step > 0.0:
            continue
        signal = joint.signals[name]
        first, last = signal.longest_plateau(t)
        seconds, value = float(t[last] - t[first]), float(signal.values[first])
        low, high = extent(joint.position.values[first : last + 1])
        moved = float(high - low)
        is_end = value in signal.ends and signal.clipped_share > 0.0
        if seconds > FROZEN_S and moved > FROZEN_SHARE * joint.reach > 0.0 and not is_end:
            yield (
                f'the {name} of {joint.name} stays {value:.3g} for {seconds:.3g} s from '
                f'{t[first]:.3g} s on, while its position changes by {moved:.3g}'
            )


@joint_check('position_frozen', Severity.WARNING, 'leave this part of the recording out')
def position_frozen(joint: Joint) -> Iterator[str]:
    """A position does not change for more than a second while the velocity goes on."""
    if 'velocity' not in joint.signals or joint.t.size < 2:
        return
    first, last = joint.position.longest_plateau(joint.t)
    velocity = thinned(joint.signals['velocity'].values[first : last + 1], MOST_VALUES)
    seconds = float(joint.t[last] - joint.t[first])
    way = float(np.median(np.abs(velocity))) * seconds
    if seconds > FROZEN_S and way > max(FROZEN_SHARE * joint.reach, LEAST_WAY):
        yield (
            f'the position of {joint.name} stays {joint.position.values[first]:.3g} for '
            f'{seconds:.3g} s from {joint.t[first]:.3g} s on, while its velocity goes on'
        )
