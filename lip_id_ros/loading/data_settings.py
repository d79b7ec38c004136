"""Settings of data: selected for recordings, or known from the provenance of data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset.provenance import SELECTED
from lip_id_ros.errors import ConfigError
from lip_id_ros.loading.preprocessing_selection import select_preprocessing
from lip_id_ros.preprocessing.smoothing import longest_step
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.timing import gap_starts
from lip_id_ros.settings import AUTO, Config, override, PreprocessingSettings

SECTIONS = ('recording', 'preprocessing')
"""Settings in the provenance of a recording."""

ROUNDING = 1e-6
"""Of sums of times [s]."""


def selected_config(
    recordings: Sequence[JointSamples],
    config: Config,
    training_share: float,
    progress: Progress = silent,
) -> tuple[Config, dict[str, Any]]:
    """
    Select the preprocessing of recordings by the first share of them.

    Returns settings with numbers in the place of `auto`, and an entry for sources' provenance.

    LipIdError: see `lip_id_ros.loading.preprocessing_selection.select_preprocessing`.
    """
    longest = config.preprocessing.max_gap_s
    some = first_share(recordings, training_share, longest)
    selected = select_preprocessing(some, config.preprocessing, config.recording, progress)
    changed = replace(config, preprocessing=selected.preprocessing, recording=selected.recording)
    return changed, {SELECTED: selected.report}


def settings_of(provenance: Mapping[str, Any]) -> Config:
    """Return the settings of the first source that was preprocessed, else the default ones."""
    for source in provenance.get('sources', ()):
        if isinstance(source, Mapping) and all(name in source for name in SECTIONS):
            values = {
                f'{section}.{name}': value
                for section in SECTIONS
                for name, value in source[section].items()
            }
            return override(Config(), values, 'the settings of the training data')
    return Config()


def with_selected(config: Config, provenance: Mapping[str, Any]) -> Config:
    """
    Put the settings selected for training data, or a model, in the place of `cutoff_hz: auto`.

    ConfigError if none of its sources was preprocessed.
    """
    if config.preprocessing.cutoff_hz != AUTO:
        return config
    for source in provenance.get('sources', ()):
        if all(name in source for name in SECTIONS):
            names = ('cutoff_hz', 'derivative')
            chosen = {f'preprocessing.{name}': source['preprocessing'][name] for name in names}
            chosen['recording.effort_delay_s'] = source['recording'].get('effort_delay_s', ())
            return override(config, chosen, 'the settings of the training data')
    raise ConfigError(
        'preprocessing.cutoff_hz: auto needs the settings of the training data, which were no '
        'recordings; give the cut-off as a number.'
    )


def first_share(
    recordings: Sequence[JointSamples], share: float, longest_s: float = 0.0
) -> list[JointSamples]:
    """Return the first share of all recorded time, of which gaps are none."""
    elapsed = [_elapsed(samples.t, longest_s) for samples in recordings]
    rest = share * sum(float(each[-1]) for each in elapsed)
    first = []
    for samples, each in zip(recordings, elapsed, strict=True):
        if rest > 0.0:
            first.append(samples.rows(slice(0, int(np.searchsorted(each, rest + ROUNDING)))))
        rest -= float(each[-1])
    return first


def _elapsed(t: Array, longest_s: float) -> Array:
    """Return the recorded time up to each sample, shape (N,) [s]."""
    if t.size < 2:
        return np.zeros(t.size or 1)
    steps = np.diff(t, prepend=t[0])
    usual = PreprocessingSettings().cutoff
    steps[gap_starts(t, longest_s or longest_step(t, usual)) + 1] = 0.0
    return np.cumsum(steps)
