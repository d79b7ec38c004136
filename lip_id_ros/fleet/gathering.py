"""The second pass over a recording: read it once more, and gather its statistics."""

from __future__ import annotations

import os

from lip_id_ros.dataset import Dataset
from lip_id_ros.fleet.parts import first_part
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.recording_factors import gather, RecordingFactors
from lip_id_ros.identification.sample_selection import explained, moving, plausible, remembering
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import for_training
from lip_id_ros.settings import Config


def gathered_from(
    path: str | os.PathLike[str],
    around: Linearisation,
    blocks: int,
    config: Config,
    share: float = 1.0,
) -> RecordingFactors:
    """
    Read a recording and gather its statistics; raises what `load_dataset` raises.

    `blocks`: in which the statistics are kept apart. `share`: first share of the samples that is
    learned from.
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
