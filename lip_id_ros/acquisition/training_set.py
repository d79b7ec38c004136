"""One data set of a live recording and of bags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.preprocessing import load_dataset, preprocess
from lip_id_ros.preprocessing.loading import Watch
from lip_id_ros.preprocessing.selection import at_most
from lip_id_ros.progress import Progress
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import Config


@dataclass(frozen=True)
class TrainingSet:
    """
    A data set, and the part of the live recording that is not in it.

    Attributes
    ----------
    dataset : Dataset
    left_out : sequence of str
        One sentence for each section that could not be used.
    n_thinned : int
        Samples that the bound `max_samples` left out.

    """

    dataset: Dataset
    left_out: Sequence[str] = ()
    n_thinned: int = 0


def training_set(
    sections: Sequence[JointSamples],
    bags: Sequence[str],
    config: Config,
    progress: Progress,
    watch: Watch = lambda samples: None,
) -> TrainingSet:
    """
    Join a live recording and bags.

    Parameters
    ----------
    sections : sequence of JointSamples
        The live recording; a section that is too short is left out, unless nothing else is there.
    bags : sequence of str
        Recordings and data sets; where the settings name no joints, they must have those of the
        live recording.
    config : Config
        Sections `recording` and `preprocessing` are used.
    progress : callable
    watch : callable
        Called with the raw samples of every recording that is used.

    Raises
    ------
    LipIdError
        If a bag cannot be used, or nothing is left.
    OSError
        If a bag does not exist or cannot be opened.

    """
    live, left_out = _of_sections(sections, config, watch)
    if not live and not bags:
        raise DataError(left_out[0])
    whole = replace(config, preprocessing=replace(config.preprocessing, max_samples=0))
    parts = (
        [*live, load_dataset(bags, _with_joints(whole, live), progress, watch)] if bags else live
    )
    joined = concatenate(parts)
    dataset = at_most(joined, config.preprocessing)
    return TrainingSet(dataset, left_out, joined.n_samples - dataset.n_samples)


def _of_sections(
    sections: Sequence[JointSamples], config: Config, watch: Watch
) -> tuple[list[Dataset], list[str]]:
    usable, left_out = [], []
    settings = replace(config.preprocessing, max_samples=0)
    for samples in sections:
        try:
            usable.append(preprocess(samples, settings, config.recording))
        except DataError as error:
            left_out.append(str(error))
        else:
            watch(samples)
    return usable, left_out


def _with_joints(config: Config, live: Sequence[Dataset]) -> Config:
    if config.recording.joints or not live:
        return config
    return replace(config, recording=replace(config.recording, joints=live[0].joint_names))
