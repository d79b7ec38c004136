"""The low-pass of the samples, from the provenance of a data set."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


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
