"""A recording cut into segments: stale samples removed, efforts as torques, stamps mended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import DataError
from lip_id_ros.joint_types import is_prismatic, REVOLUTE
from lip_id_ros.preprocessing.continuity import (
    contradicted,
    jumps,
    refuse_absurd_ranges,
    refuse_wrong_units,
    spikes,
    unwrapped,
)
from lip_id_ros.preprocessing.sample_times import (
    Changes,
    changes_between,
    evenly_timed,
    longest_silence,
    retimed,
    source_periods,
    without_stale,
)
from lip_id_ros.preprocessing.segment import per_joint, Segment, segment_of, torque
from lip_id_ros.preprocessing.smoothing import cut, is_filtered, longest_step
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.spill import release, thinned
from lip_id_ros.recording.timing import GAP_STEPS, median_step, MOST_STEPS, some_steps
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

MOST_RATE = 2.0
"""Samples are brought to a rate of at most so many times their mean rate."""

LASTING_S, FASTER, MOST_LASTING_RATE = 5.0, 1.5, 10.0
"""A part that lasts so long and is so many times as fast as most gives the rate, up to so many
times the mean."""

LEAST_REPETITION = 4
ON_GRID = 0.9
MOST_VALUES = 50_000


def segments_of(
    samples: JointSamples, settings: PreprocessingSettings, recording: RecordingSettings
) -> tuple[list[Segment], dict[str, Any]]:
    """
    Remove stale samples, scale efforts to torques, cut at gaps and jumps, and mend stamps.

    Recorded velocities are not used in segments where they contradict the positions of a joint.
    Returns at least one, and what was found, for the provenance. SourceError if no effort was
    recorded; ConfigError if a setting per joint has another length than there are joints;
    DataError if there are fewer than two different samples, or times or positions in another unit.
    """
    fresh, changes, is_stale = without_stale(samples)
    _require_two(fresh)
    given = replace(fresh, effort=torque(fresh, recording))
    if (is_spike := spikes(given.effort)).any():
        given = given.select(~is_spike)
        _require_two(given, ' without spikes of the effort')
        changes = changes_between(changes, ~is_spike)
    refuse_absurd_ranges(given)
    is_revolute = ~is_prismatic(per_joint(samples, 'joint_types', recording.joint_types, REVOLUTE))
    fresh = unwrapped(given, is_revolute, _longest_gap(given, settings))
    periods = source_periods(changes)
    spread = _spread(fresh)
    parts, n_jumps = uninterrupted(spread, changes, periods, _longest_gap(spread, settings))
    pieces = [spread.rows(rows) for rows in parts]
    stamps = [_retimed(piece, samples.t, is_stale) for piece in pieces]
    rate = _rate(stamps, settings.cutoff)
    delays = per_joint(samples, 'effort_delay_s', recording.effort_delay_s, 0.0)
    is_wanted = samples.has_velocity and settings.velocity == 'recorded'
    wrong = [contradicted(piece) if is_wanted else () for piece in pieces]
    if any(wrong):
        refuse_wrong_units(fresh)
    used = [is_wanted and not joints for joints in wrong]
    segments = [segment_of(fresh, rows, changes, periods, rate) for rows in parts]
    segments = [
        replace(each, t=t, delays_s=delays, velocity=each.velocity if is_used else None)
        for each, t, is_used in zip(segments, stamps, used, strict=True)
    ]
    mended = (t is not piece.t for t, piece in zip(stamps, pieces, strict=True))
    return segments, {
        'velocity': 'recorded' if any(used) else 'differentiated from position',
        'velocity_contradicted': sorted({joint for joints in wrong for joint in joints}),
        'rate_hz': rate,
        'repeated': {
            'positions': int(np.count_nonzero(~changes['position'])),
            'position_steps': _position_steps(fresh),
        },
        'spikes': int(np.count_nonzero(is_spike)),
        'unwrapped': fresh is not given,
        'jumps': n_jumps,
        'retimed': spread is not fresh or any(mended),
        'source_periods': {name: k for name, k in periods.items() if k > 1},
    }


def uninterrupted(
    fresh: JointSamples, changes: Changes, periods: Mapping[str, int], longest_s: float
) -> tuple[list[slice], int]:
    """Return the rows between gaps and jumps of positions, and the number of the jumps."""
    at_jumps = jumps(fresh, changes['position'], periods['position'])
    starts = [rows.start for rows in cut(fresh.t, longest_s)]
    ends = [*sorted({*starts, *at_jumps.tolist()} - {0}), fresh.n_samples]
    return [slice(*each) for each in pairwise([0, *ends])], at_jumps.size


def quantum(values: Array) -> float:
    """Return the step of a quantised signal, shape (N,); 0 where there is none to be seen."""
    values = thinned(values, MOST_VALUES)
    levels = np.unique(values)
    if levels.size < 2 or LEAST_REPETITION * levels.size > values.size:
        return 0.0
    steps = np.diff(levels)
    step = float(np.median(steps[steps <= 1.5 * np.percentile(steps, 20)]))
    multiples = steps / step
    on_grid = np.abs(multiples - np.round(multiples)) < 0.1
    return step if on_grid.mean() > ON_GRID else 0.0


def _require_two(samples: JointSamples, kind: str = '') -> None:
    if samples.n_samples < 2:
        raise DataError(
            f'{samples.source} must hold at least two different samples{kind}, but has '
            f'{samples.n_samples}; record while the arm moves.'
        )


def _longest_gap(samples: JointSamples, settings: PreprocessingSettings) -> float:
    return settings.max_gap_s or longest_step(samples.t, settings.cutoff)


def _position_steps(samples: JointSamples) -> dict[str, float]:
    steps = {}
    for joint, name in enumerate(samples.joint_names):
        steps[name] = quantum(samples.position[:, joint])
        release(samples.position)
    return {name: step for name, step in steps.items() if step > 0.0}


def _spread(samples: JointSamples) -> JointSamples:
    silence = longest_silence(samples.t)
    if not silence:
        return samples
    parts = [samples.rows(rows) for rows in cut(samples.t, GAP_STEPS * silence)]
    t = np.concatenate([retimed(part.t, part.position) for part in parts])
    is_changed = (t != samples.t).any() and (np.diff(t) > 0.0).all()
    return replace(samples, t=t) if is_changed else samples


def _retimed(segment: JointSamples, t: Array, is_stale: BoolArray) -> Array:
    """Mend the stamps of a segment, given those of all samples and which were left out."""
    first, last = np.searchsorted(t, segment.t[[0, -1]])
    even = segment.t
    if is_stale[first:last].any():
        even = evenly_timed(even, median_step(t))
    return retimed(even, segment.position) if even is segment.t else even


def _rate(stamps: Sequence[Array], cutoff_hz: float) -> float:
    """
    Return the rate of most steps [Hz], no more than twice the mean, as messages in bursts.

    Where a low-pass follows, it is that of a faster part that lasts: what is fast there would be
    taken for slow.
    """
    count = sum(t.size - 1 for t in stamps)
    if not count:
        return 0.0
    mean = count / sum(float(t[-1] - t[0]) for t in stamps)
    share = min(1.0, MOST_STEPS / count)
    steps = [some_steps(t, round(share * t.size)) for t in stamps]
    usual = min(1.0 / float(np.median(np.concatenate(steps))), MOST_RATE * mean)
    lasting = min(max(map(_lasting_rate, stamps)), MOST_LASTING_RATE * mean)
    return lasting if lasting > FASTER * usual and is_filtered(usual, cutoff_hz) else usual


def _lasting_rate(t: Array) -> float:
    """Return the highest mean rate over some seconds, 0 for less time."""
    begins = thinned(t, MOST_VALUES)
    begins = begins[begins + LASTING_S <= t[-1]]
    first = np.searchsorted(t, begins)
    last = np.searchsorted(t, begins + LASTING_S, side='right') - 1
    lasts = np.maximum(t[last] - t[first], 0.9 * LASTING_S)
    return float(((last - first) / lasts).max(initial=0.0))
