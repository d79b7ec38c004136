"""The first share of the samples of many recordings, to learn from, and the rest of them."""

from __future__ import annotations

from collections.abc import Mapping

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError


def first_shares(counts: Mapping[int, int], share: float) -> dict[int, float]:
    """
    Return of each recording the first share that is among the first samples of all.

    `counts`: samples of recordings, by their numbers in the order of their sources, one after the
    other. One recording at most is cut; of those after it the share is 0. DataError if nothing
    would be left on one side.
    """
    total = sum(counts.values())
    rest = round(share * total)
    if not 0 < rest < total:
        raise DataError(
            f'a share {share:g} of {total} samples leaves nothing to learn from, or to hold out; '
            'choose another, or record longer.'
        )
    shares = {}
    for number in sorted(counts):
        shares[number] = min(rest / counts[number], 1.0) if counts[number] else 0.0
        rest -= round(shares[number] * counts[number])
    return shares


def first_part(data: Dataset, share: float) -> Dataset:
    """Return the first samples of a recording, all of them where the share is 1."""
    return data if share >= 1.0 else data.split(share)[0]


def last_part(data: Dataset, share: float) -> Dataset:
    """Return the samples after the first share, all of them where it is 0."""
    return data if share <= 0.0 else data.split(share)[1]
