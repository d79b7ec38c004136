"""
Settings of data: selected by the prediction of left-out blocks, or known from provenance.

Of cut-off, derivative and delays of efforts, what is usual stays unless something else predicts
left-out efforts better for sure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.dataset.formats import SELECTED
from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.left_out import Gain
from lip_id_ros.loading.delay_selection import DelaySelection, REACH_S
from lip_id_ros.loading.left_out_torques import LeftOutTorques, uniform_segments
from lip_id_ros.preprocessing.pipeline import preprocess
from lip_id_ros.preprocessing.segment import Segment
from lip_id_ros.preprocessing.segments import segments_of
from lip_id_ros.preprocessing.smoothing import DERIVATIVES, longest_step
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.timing import gap_starts
from lip_id_ros.settings import AUTO, Config, override, PreprocessingSettings, RecordingSettings

STAGE = 'selection of preprocessing'
CUTOFFS_HZ = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0)
HIGHEST = 0.4
"""Highest cut-off that is tried, in sampling rates."""

LEAST_LEFT = 0.5
"""Share of a recording that the edges of the lowest cut-off must leave."""

ROUNDS = 2
"""With joints placed by usual samples, then by those that were selected."""

LEAST_SAMPLES_PER_JOINT = 30
SEED = 0


@dataclass(frozen=True, eq=False)
class Selected:
    """Settings with cut-off, derivative and delays as selected, and figures for the provenance."""

    preprocessing: PreprocessingSettings
    recording: RecordingSettings
    report: dict[str, Any]


def select_preprocessing(
    recordings: Sequence[JointSamples],
    settings: PreprocessingSettings,
    recording: RecordingSettings,
    progress: Progress = silent,
) -> Selected:
    """
    Select cut-off, derivative and delays for recordings of one arm, training data alone.

    SourceError, ConfigError and DataError as from `preprocess`; ConfigError where a derivative or
    delays are given.
    """
    _refuse_mixed(settings, recording)
    if len({samples.joint_names for samples in recordings}) > 1:
        raise ConfigError(
            'preprocessing.cutoff_hz: -1 needs recordings with one order of joints, but theirs '
            'differ; name the joints from base to tip in recording.joints.'
        )
    usual = replace(settings, cutoff_hz=PreprocessingSettings().cutoff_hz, max_samples=0)
    data, used = _usable(recordings, usual, recording)
    raw = [each for samples in used for each in segments_of(samples, usual, recording)[0]]
    cutoffs = _cutoffs(raw, usual)
    segments = uniform_segments(raw, usual, cutoffs[0], REACH_S)
    count = sum(each.n_samples - 2 * edge for each, edge in segments)
    if count < LEAST_SAMPLES_PER_JOINT * data.n_joints:
        chosen = replace(settings, cutoff_hz=usual.cutoff)
        return Selected(chosen, recording, {'too_few_samples': count})
    now = usual
    for number in range(ROUNDS):
        progress(STAGE, number, ROUNDS + 1)
        judge = _judge(data, segments, cutoffs[-1], now)
        selected, errors = _smoothing(judge, usual, cutoffs)
        if selected == now:
            break
        data, now = concatenate([preprocess(each, selected, recording) for each in used]), selected
    progress(STAGE, ROUNDS, ROUNDS + 1)
    delays, delay_report = DelaySelection(judge, judge.smoothed(selected)).selected()
    if delays.any():  # late efforts have placed the joints a little wrongly
        early = replace(recording, effort_delay_s=tuple(delays.tolist()))
        data = concatenate([preprocess(each, selected, early) for each in used])
        judge = _judge(data, segments, cutoffs[-1], selected)
        delays, delay_report = DelaySelection(judge, judge.smoothed(selected)).selected()
    progress(STAGE, ROUNDS + 1, ROUNDS + 1)
    report = {
        'samples': judge.n_samples,
        'cutoff_hz': selected.cutoff,
        'derivative': selected.derivative,
        'unexplained_left_out_percent': errors,
        'effort_delay_s': delays.tolist(),
        **delay_report,
    }
    given = tuple(delays.tolist()) if delays.any() else ()
    chosen = replace(settings, cutoff_hz=selected.cutoff, derivative=selected.derivative)
    return Selected(chosen, replace(recording, effort_delay_s=given), report)


def _judge(
    data: Dataset,
    segments: Sequence[tuple[Segment, int]],
    highest_hz: float,
    settings: PreprocessingSettings,
) -> LeftOutTorques:
    """Place the joints by preprocessed recordings."""
    fitter = ArmFitter(data)
    chain = ArmSearch(fitter).calibrated(SEED, silent).placements.chain
    return LeftOutTorques(segments, highest_hz, chain, fitter.link_std, settings)


def _usable(
    recordings: Sequence[JointSamples], usual: PreprocessingSettings, recording: RecordingSettings
) -> tuple[Dataset, list[JointSamples]]:
    """Return the recordings that are long enough, smoothed as usual and as they are."""
    data, used = [], []
    for samples in recordings:
        try:
            data.append(preprocess(samples, usual, recording))
        except DataError:
            if len(recordings) == 1:
                raise
        else:
            used.append(samples)
    if not data:
        raise DataError(
            'the preprocessing is selected by recordings that are long enough, but none of '
            f'{len(recordings)} is; record for longer, or give preprocessing.cutoff_hz a number.'
        )
    return concatenate(data), used


def _refuse_mixed(settings: PreprocessingSettings, recording: RecordingSettings) -> None:
    given = []
    if settings.derivative != PreprocessingSettings().derivative:
        given.append('preprocessing.derivative')
    if recording.effort_delay_s:
        given.append('recording.effort_delay_s')
    if given:
        raise ConfigError(
            f'preprocessing.cutoff_hz: -1 selects {" and ".join(given)} too, but a value is '
            'given; leave it out, or give the cut-off as a number.'
        )


def _cutoffs(raw: Sequence[Segment], usual: PreprocessingSettings) -> list[float]:
    """Return the cut-offs that rates and lengths of recordings allow, the usual among them."""
    rate = min(each.rate_hz for each in raw)
    lengths = np.array([each.duration_s for each in raw])

    def left(cutoff: float) -> float:
        edges = usual.edge_periods / cutoff + REACH_S
        return float(np.maximum(lengths - 2.0 * edges, 0.0).sum())

    least = LEAST_LEFT * left(usual.cutoff)
    allowed = [c for c in CUTOFFS_HZ if c < HIGHEST * rate and left(c) >= least]
    return sorted({usual.cutoff, *allowed})


def _smoothing(
    judge: LeftOutTorques, usual: PreprocessingSettings, cutoffs: Sequence[float]
) -> tuple[PreprocessingSettings, dict[str, float]]:
    """Select the cut-off, then the derivative; return the errors of all cut-offs too [%]."""

    def squares(settings: PreprocessingSettings) -> Array:
        return judge.squares(judge.grams(judge.smoothed(settings)))

    errors = {c: squares(replace(usual, cutoff_hz=c)) for c in cutoffs}
    now = errors[usual.cutoff]
    best = min(errors.values(), key=lambda each: float(np.log(each).mean()))
    selected = usual
    if Gain.between([now], [best]).is_sure():
        level = [c for c in cutoffs if not Gain.between([errors[c]], [best]).is_sure(errors=1.0)]
        nearest = min(level, key=lambda c: abs(np.log(c / usual.cutoff)))
        selected = replace(usual, cutoff_hz=nearest)
    for derivative in DERIVATIVES:
        other = replace(selected, derivative=derivative)
        if Gain.between([errors[selected.cutoff]], [squares(other)]).is_sure():
            selected = other
    return selected, {f'{c:g}': judge.percent(each) for c, each in errors.items()}


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

    Returns settings with numbers for `cutoff_hz: -1`, and an entry for sources' provenance.

    LipIdError: see `lip_id_ros.loading.data_settings.select_preprocessing`.
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
    Put the settings selected for training data, or a model, in the place of `cutoff_hz: -1`.

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
        'preprocessing.cutoff_hz: -1 needs the settings of the training data, which were no '
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
