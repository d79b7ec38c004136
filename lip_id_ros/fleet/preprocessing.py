"""Preprocessing of many recordings, selected by cross-validation on some of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
import json
from typing import Any

from lip_id_ros.fleet.passes import digest, Passes, Source
from lip_id_ros.loading.data_settings import SECTIONS, selected_config
from lip_id_ros.loading.load import read_raw
from lip_id_ros.packable import Packable
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import AUTO, Config, flatten, override, PreprocessingSettings

MOST_RECORDINGS = 6
"""Recordings that preprocessing is selected on; they are in memory together."""


@dataclass(frozen=True, eq=False)
class SelectedPreprocessing(Packable):
    """Settings by ``section.name``, and entries for the provenance of recordings: both as JSON."""

    KIND = 'preprocessing'
    settings: str
    entries: str


def is_automatic(config: Config) -> bool:
    """Whether cut-off, derivative and delays are to be selected."""
    return config.preprocessing.cutoff_hz == AUTO


def usual(config: Config) -> Config:
    """Return the settings with the usual cut-off in the place of `auto`."""
    if not is_automatic(config):
        return config
    cutoff = PreprocessingSettings().cutoff_hz
    return replace(config, preprocessing=replace(config.preprocessing, cutoff_hz=cutoff))


def selected(
    some: Sequence[tuple[Source, float]],
    joint_names: tuple[str, ...],
    config: Config,
    passes: Passes,
) -> tuple[Config, Mapping[str, Any]]:
    """
    Select preprocessing by the first shares of some recordings, whose joints have this order.

    Returns settings with numbers in the place of `auto`, and entries for the provenance of
    recordings; raises what `load_dataset` raises with `auto`.
    """
    given = config.recording, config.preprocessing
    key = digest('preprocessing', *given, [(each.fingerprint, share) for each, share in some])
    found = passes.restored(SelectedPreprocessing, key)
    if found is None:
        raw = [part for each, share in some for part in _first(each, share, config)]
        chosen, entries = selected_config(raw, config, 1.0, passes.progress)
        if chosen.recording.effort_delay_s and not chosen.recording.joints:
            # so that they are those of the same joints in recordings of another order
            recording = replace(chosen.recording, joints=joint_names)
            chosen = replace(chosen, recording=recording)
        of_data = {name: x for name, x in flatten(chosen).items() if name.startswith(SECTIONS)}
        found = SelectedPreprocessing(json.dumps(of_data), json.dumps(entries))
        passes.keep(key, found)
    entries = json.loads(found.entries)
    return override(config, json.loads(found.settings), 'the selection'), entries


def _first(source: Source, share: float, config: Config) -> list[JointSamples]:
    with source.local() as path:
        raw = read_raw(path, config)
    return [each.rows(slice(0, round(share * each.n_samples))) for each in raw]
