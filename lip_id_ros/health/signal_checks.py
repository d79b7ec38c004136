"""Stamps and raw signals: rates, gaps, coarse steps, frozen values, outliers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import check, JointText, Severity
from lip_id_ros.preprocessing.cleaning import quantum
from lip_id_ros.recording.spill import release
from lip_id_ros.recording.timing import gap_starts, GAP_STEPS, median_step

SHORT_S = 20.0
LOW_RATE_HZ = 20.0
MOST_JITTER = 0.2
MOST_DROPPED = 0.01
MOST_STALE = 0.01
MOST_GAPS_PER_MINUTE = 6.0
COARSE = {'position': 0.01, 'velocity': 0.1, 'effort': 0.1}
"""Largest step in standard deviations of the signal."""
FROZEN_S = 1.0
OUTLIER_PERCENT = 1.0
OUTLIER_RANGES = 10.0
LEAST_RANGE = 1e-3
FROZEN_SHARE = 0.2
TOP_WIDTH = 0.002
LEAST_TOP = 0.005
TOP_OVER_NEXT = 5
LEAST_RUN = 5


@check(
    'short',
    Severity.WARNING,
    'The recording lasts less than 20 s.',
    'record a minute or more',
)
def short(evidence: Evidence) -> Iterator[JointText]:
    """Find recordings of less than 20 s."""
    t = evidence.samples.t
    duration = float(t[-1] - t[0]) if t.size else 0.0
    if duration < SHORT_S:
        yield ('', f'the recording lasts {duration:.3g} s')


@check(
    'low_rate',
    Severity.WARNING,
    'Samples come at less than 20 Hz.',
    'raise the publishing rate, or move slowly enough for it',
)
def low_rate(evidence: Evidence) -> Iterator[JointText]:
    """Find rates below 20 Hz."""
    step = median_step(evidence.samples.t)
    if step > 1.0 / LOW_RATE_HZ:
        yield ('', f'samples come at {1.0 / step:.3g} Hz')


@check(
    'jitter',
    Severity.NOTE,
    'Steps between samples scatter by more than a fifth.',
    'let the driver stamp the messages when it reads the encoders',
)
def jitter(evidence: Evidence) -> Iterator[JointText]:
    """Find steps that scatter by more than a fifth of the median step."""
    steps = np.diff(evidence.samples.t)
    if steps.size < 2:
        return
    typical = float(np.median(steps))
    scatter = float(np.std(steps[steps <= GAP_STEPS * typical]))
    if scatter > MOST_JITTER * typical:
        yield (
            '',
            f'the steps between samples scatter by {1e3 * scatter:.3g} ms around '
            f'{1e3 * typical:.3g} ms',
        )


@check(
    'gaps',
    Severity.WARNING,
    'More than six gaps in a minute; motion is cut at each, and its edges are lost.',
    "record on the robot's own computer, or set preprocessing.max_gap_s",
)
def gaps(evidence: Evidence) -> Iterator[JointText]:
    """Find recordings that are cut into many pieces."""
    t = evidence.samples.t
    starts = gap_starts(t, GAP_STEPS * median_step(t))
    if starts.size and starts.size > MOST_GAPS_PER_MINUTE * (t[-1] - t[0]) / 60.0:
        longest = float(np.diff(t)[starts].max())
        yield ('', f'the recording has {starts.size} gaps, the longest of {longest:.3g} s')


@check(
    'dropped',
    Severity.WARNING,
    'More than one message in a hundred cannot be used.',
    'look at the reasons, and choose topic and joints by recording.topic and recording.joints',
)
def dropped(evidence: Evidence) -> Iterator[JointText]:
    """Find recordings in which more than one message in a hundred cannot be used."""
    counts = {str(reason): count for reason, count in evidence.samples.counts.items() if count}
    lost = sum(counts.values())
    total = lost + evidence.samples.n_samples
    if lost > MOST_DROPPED * total:
        reasons = ', '.join(f'{reason}: {count}' for reason, count in counts.items())
        yield ('', f'{lost} of {total} messages cannot be used ({reasons})')


@check(
    'stale',
    Severity.NOTE,
    'More than one sample in a hundred repeats the one before under a new stamp.',
    'nothing needs to be done, they are left out; better publish no faster than the driver reads',
)
def stale(evidence: Evidence) -> Iterator[JointText]:
    """Find recordings in which more than one sample in a hundred repeats the one before."""
    share = evidence.stale_share
    if share > MOST_STALE:
        yield ('', f'{100 * share:.2g} % of the samples repeat the one before under a new stamp')


@check(
    'outliers',
    Severity.WARNING,
    'A few samples, at most one in a hundred, lie further from all others than ten times the '
    'range of those.',
    'see what the driver publishes at these times, and leave this part of the recording out',
)
def outliers(evidence: Evidence) -> Iterator[JointText]:
    """Find values that cannot be of the same motion as the others."""
    if not evidence.samples.n_samples:
        return
    for signal in evidence.quanta:
        for _, name, values in evidence.columns(signal):
            low = float(np.percentile(values, OUTLIER_PERCENT, method='higher'))
            high = float(np.percentile(values, 100.0 - OUTLIER_PERCENT, method='lower'))
            reach = OUTLIER_RANGES * max(high - low, LEAST_RANGE)
            count = int(((values < low - reach) | (values > high + reach)).sum())
            if count:
                yield (
                    name,
                    f'{count} samples of the {signal} of {name} are outliers (up to '
                    f'{np.abs(values).max():.3g}, where 98 % lie from {low:.3g} to {high:.3g})',
                )


@check(
    'coarse',
    Severity.NOTE,
    'A signal comes in steps: a position of more than 1 %, a velocity or effort of more than '
    '10 % of its standard deviation.',
    'record it with more digits, or move more',
)
def coarse(evidence: Evidence) -> Iterator[JointText]:
    """Find signals that take few values."""
    for signal, quanta in evidence.quanta.items():
        for joint, name, values in evidence.columns(signal):
            step = quanta[joint]
            if step == 0.0 or not evidence.moves(joint):
                continue
            deviation = float(np.std(values))
            if step > COARSE[signal] * deviation:
                yield (
                    name,
                    f'the {signal} of {name} comes in steps of {step:.3g}, '
                    f'{100 * step / deviation:.2g} % of its standard deviation',
                )


@check(
    'frozen',
    Severity.WARNING,
    'A velocity or effort stays exactly the same for more than a second while the joint moves'
    ' over a fifth of its range; not judged where it comes in steps.',
    'leave this part of the recording out',
)
def frozen(evidence: Evidence) -> Iterator[JointText]:
    """Find efforts and velocities that stop for a while although the joint moves."""
    samples = evidence.samples
    for signal, quanta in evidence.quanta.items():
        if signal == 'position':
            continue
        for joint, name, values in evidence.columns(signal):
            if values.size < 2 or np.ptp(values) == 0.0 or quanta[joint] > 0.0:
                continue
            first, last = longest_plateau(samples.t, values)
            seconds = float(samples.t[last] - samples.t[first])
            moved = float(np.ptp(samples.position[first : last + 1, joint]))
            release(samples.position)
            if not (seconds > FROZEN_S and moved > FROZEN_SHARE * evidence.reach[joint] > 0.0):
                continue
            is_end = values[first] in (values.min(), values.max()) and clipped_share(values)
            if not is_end:
                yield (
                    name,
                    f'the {signal} of {name} stays {values[first]:.3g} for {seconds:.3g} s from '
                    f'{samples.t[first]:.3g} s on, while its position changes by {moved:.3g}',
                )


@check(
    'position_frozen',
    Severity.WARNING,
    'A position stays exactly the same for more than a second while the velocity goes on.',
    'leave this part of the recording out',
)
def position_frozen(evidence: Evidence) -> Iterator[JointText]:
    """Find positions that stop for a while although the recorded velocity goes on."""
    samples = evidence.samples
    if not samples.has_velocity or samples.n_samples < 2:
        return
    for joint, name, values in evidence.columns('position'):
        first, last = longest_plateau(samples.t, values)
        t = samples.t[first : last + 1]
        speed = np.abs(samples.velocity[first : last + 1, joint])
        release(samples.velocity)
        seconds = float(t[-1] - t[0])
        way = float(np.median(speed)) * seconds
        if seconds > FROZEN_S and way > max(FROZEN_SHARE * evidence.reach[joint], 0.05):
            yield (
                name,
                f'the position of {name} stays {values[first]:.3g} for '
                f'{seconds:.3g} s from {t[0]:.3g} s on, while its velocity goes on',
            )


def longest_plateau(t: Array, values: Array) -> tuple[int, int]:
    """Return first and last row of the longest time [s] that a signal stays exactly the same."""
    edges = _edges(values[1:] == values[:-1])
    if not edges.size:
        return 0, 0
    starts, ends = edges[::2], edges[1::2]
    longest = int(np.argmax(t[ends] - t[starts]))
    return int(starts[longest]), int(ends[longest])


def clipped_share(values: Array) -> float:
    """
    Return the share of samples that lie on a flat end of a signal's range.

    A sine that is only quantised has at most two and a half times as many samples on its last
    level as on the one before; a clipped signal has far more.

    Parameters
    ----------
    values : ndarray, shape (N,)

    """
    low, high = float(values.min()), float(values.max())
    if low == high:
        return 0.0
    width = max(TOP_WIDTH * (high - low), 0.5 * quantum(values))
    return max(
        _flat_end(values >= high - width, values >= high - 3.0 * width),
        _flat_end(values <= low + width, values <= low + 3.0 * width),
    )


def _flat_end(top: BoolArray, nearby: BoolArray) -> float:
    count = int(top.sum())
    following = int(nearby.sum()) - count
    share = float(count / top.size)
    steep = count >= TOP_OVER_NEXT * (following + 1) and _longest_run(top) >= LEAST_RUN
    return share if steep and share >= LEAST_TOP else 0.0


def _longest_run(mask: BoolArray) -> int:
    edges = _edges(mask)
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _edges(mask: BoolArray) -> IndexArray:
    """Return where runs of True begin and, one behind, where they end, in turns."""
    return np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
