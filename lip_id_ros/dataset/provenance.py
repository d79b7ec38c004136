"""What the provenance of a data set has beside settings: keys, and the low-pass of the samples."""

from __future__ import annotations

from collections.abc import Mapping
from statistics import median
from typing import Any

COPIES = 'copies'
"""Source, samples and repeated samples where an earlier source has them too."""

SELECTED = 'elected'
"""Of a source: how its preprocessing was selected."""

FINDINGS = 'findings'
"""Of a source: errors and warnings of `lip_id_ros.health`, as JSON."""

N_NOTES = 'notes_of_health'
"""Of a source: how many notes `lip_id_ros.health` has beside them."""


def cutoffs_hz(provenance: Mapping[str, Any]) -> set[float | None]:
    """Return the cut-offs of all sources [Hz], 0 without a low-pass; None where not known."""
    cutoffs: set[float | None] = set()
    for source in provenance.get('sources', ()):
        # a fleet lists settings once, simulations and arrays have none
        settings = source.get('preprocessing') if isinstance(source, Mapping) else None
        cutoff = settings.get('cutoff_hz') if isinstance(settings, Mapping) else None
        if isinstance(cutoff, int | float):
            cutoffs.add(float(cutoff) if source.get('filtered', True) else 0.0)
        else:
            cutoffs.add(None)
    return cutoffs or {None}


def sample_interval_s(provenance: Mapping[str, Any]) -> float | None:
    """Return the time between samples in the median of the sources [s], None where not known."""
    intervals = []
    for source in provenance.get('sources', ()):
        known = source if isinstance(source, Mapping) else {}
        rate, kept_every = known.get('rate_hz'), known.get('kept_every')
        if isinstance(rate, int | float) and isinstance(kept_every, int) and rate > 0.0:
            intervals.append(kept_every / rate)
    return median(intervals) if intervals else None
