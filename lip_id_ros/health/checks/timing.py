"""Rates, gaps, and messages that say nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import Found
from lip_id_ros.recording.timing import gap_starts, GAP_STEPS, median_step

SHORT_S = 20.0
LOW_RATE_HZ = 20.0
MOST_JITTER = 0.2
MOST_DROPPED = 0.01
MOST_STALE = 0.01
MOST_GAPS_PER_MINUTE = 6.0


def short(evidence: Evidence) -> Iterator[Found]:
    """Find recordings of less than 20 s."""
    t = evidence.samples.t
    duration = float(t[-1] - t[0]) if t.size else 0.0
    if duration < SHORT_S:
        yield Found('', f'the recording lasts {duration:.3g} s')


def low_rate(evidence: Evidence) -> Iterator[Found]:
    """Find rates below 20 Hz."""
    step = median_step(evidence.samples.t)
    if step > 1.0 / LOW_RATE_HZ:
        yield Found('', f'samples come at {1.0 / step:.3g} Hz')


def jitter(evidence: Evidence) -> Iterator[Found]:
    """Find steps that scatter by more than a fifth of the median step."""
    steps = np.diff(evidence.samples.t)
    if steps.size < 2:
        return
    typical = float(np.median(steps))
    scatter = float(np.std(steps[steps <= GAP_STEPS * typical]))
    if scatter > MOST_JITTER * typical:
        yield Found(
            '',
            f'the steps between samples scatter by {1e3 * scatter:.3g} ms around '
            f'{1e3 * typical:.3g} ms',
        )


def gaps(evidence: Evidence) -> Iterator[Found]:
    """Find recordings that are cut into many pieces."""
    t = evidence.samples.t
    starts = gap_starts(t, GAP_STEPS * median_step(t))
    if starts.size and starts.size > MOST_GAPS_PER_MINUTE * (t[-1] - t[0]) / 60.0:
        longest = float(np.diff(t)[starts].max())
        yield Found('', f'the recording has {starts.size} gaps, the longest of {longest:.3g} s')


def dropped(evidence: Evidence) -> Iterator[Found]:
    """Find recordings of whose messages more than one in a hundred cannot be used."""
    counts = {str(reason): count for reason, count in evidence.samples.counts.items() if count}
    lost = sum(counts.values())
    total = lost + evidence.samples.n_samples
    if lost > MOST_DROPPED * total:
        reasons = ', '.join(f'{reason}: {count}' for reason, count in counts.items())
        yield Found('', f'{lost} of {total} messages cannot be used ({reasons})')


def stale(evidence: Evidence) -> Iterator[Found]:
    """Find recordings of whose samples more than one in a hundred repeat the one before."""
    share = evidence.stale_share
    if share > MOST_STALE:
        yield Found(
            '', f'{100 * share:.2g} % of the samples repeat the one before under a new stamp'
        )
