"""The first share of many recordings, to learn from, and the statistics of each."""

from __future__ import annotations

from collections.abc import Mapping
import os

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.sample_selection import explained, moving, plausible, remembering
from lip_id_ros.identification.total import gather, RecordingFactors
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import for_training
from lip_id_ros.settings import Config


def first_shares(counts: Mapping[int, int], share: float) -> dict[int, float]:
    """
    Return the first share of each recording that is among the first samples of all.

    One recording at most is cut; of those after it the share is 0. DataError if nothing would be
    left on one side.
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


def gathered_from(
    path: str | os.PathLike[str],
    around: Linearisation,
    blocks: int,
    config: Config,
    share: float = 1.0,
) -> RecordingFactors:
    """
    Read the first share of a recording and gather its statistics, in blocks kept apart.

    Raises what `load_dataset` raises.
    """
    data = load_dataset(path, config).with_joints(around.joint_names)
    data = first_part(data, share)
    data = for_training(data, config.preprocessing, config.fit.kernel)
    return gather_kept(data, around, blocks)


def gather_kept(dataset: Dataset, around: Linearisation, blocks: int = 1) -> RecordingFactors:
    """Gather the statistics of the samples that are plausible and that the arm explains."""
    dataset = moving(remembering(dataset))
    kept = plausible(dataset) & explained(around.residual(dataset))
    return gather(dataset, around, blocks, kept)
