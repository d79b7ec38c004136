"""
Usual and selected preprocessing of real recordings: ``python -m benchmarks preprocessing``.

Each is selected and fitted on 70 % of a recording. Both predict the efforts of the other 30 %, at
the same times and with the same low-pass: far above the motion, and at 2 Hz, below all cut-offs.
``--seeds 20`` counts the delays that are recovered in simulated recordings instead.
accuracy.md has both.

"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks._real import ARMS, RawRecordings, SPLITS
from benchmarks._simulated_recordings import N_JOINTS, simulated
from lip_id_ros.arrays import Array
from lip_id_ros.identification import fit
from lip_id_ros.loading.data_settings import CUTOFFS_HZ, HIGHEST, select_preprocessing
from lip_id_ros.loading.delay_selection import REACH_S
from lip_id_ros.loading.left_out_torques import target, uniform_segments
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.preprocessing.pipeline import smooth
from lip_id_ros.preprocessing.segment import Segment
from lip_id_ros.preprocessing.segments import segments_of
from lip_id_ros.preprocessing.smoothing import low_pass
from lip_id_ros.settings import AUTO, PreprocessingSettings, RecordingSettings

SLOW_HZ = 2.0
DELAY_S, LARGEST_ERROR_S = 0.008, 0.001

Settings = tuple[PreprocessingSettings, RecordingSettings]


def main(arguments: list[str]) -> int:
    """Print one line per recording and split."""
    parser = argparse.ArgumentParser(prog='benchmarks preprocessing', description=__doc__)
    parser.add_argument('--data', type=Path, default=Path('../shared/data'))
    parser.add_argument('--arms', nargs='*', default=list(ARMS))
    parser.add_argument('--seeds', type=int, default=0)
    args = parser.parse_args(arguments)
    if args.seeds:
        _counted(args.seeds)
        return 0
    ratios = []
    for arm in args.arms:
        for unseen in SPLITS:
            raw = ARMS[arm].raw_split(args.data, unseen)
            ratios.append(_compared(f'{arm}, {unseen} 30 %', *raw))
    wide, slow = np.exp(np.log(np.array(ratios)).mean(axis=0))
    print(f'geometric mean of selected / usual: {wide:.3f}, below {SLOW_HZ:g} Hz {slow:.3f}')
    return 0


def _counted(seeds: int) -> None:
    """Count delays of one drive that are recovered to 1 ms, and delays that are invented."""
    recovered = invented = 0
    for seed in range(seeds):
        delays = np.zeros(N_JOINTS)
        invented += bool(_delays(seed, delays).any())
        delays[seed % N_JOINTS] = DELAY_S
        error = np.abs(_delays(seed, delays) - delays).max()
        recovered += bool(error < LARGEST_ERROR_S)
        print(f'seed {seed}: largest error {1e3 * error:.2f} ms', flush=True)
    print(f'{recovered} of {seeds} delays of {1e3 * DELAY_S:g} ms recovered, {invented} invented')


def _delays(seed: int, true: Array) -> Array:
    samples = simulated(seed, true).samples
    auto = PreprocessingSettings(cutoff_hz=AUTO)
    found = select_preprocessing([samples], auto, RecordingSettings()).recording.effort_delay_s
    return np.array(found or np.zeros(N_JOINTS))


def _compared(title: str, train: RawRecordings, test: RawRecordings) -> tuple[float, float]:
    usual = PreprocessingSettings(), train.recording
    auto = replace(usual[0], cutoff_hz=AUTO)
    selected = select_preprocessing(train.samples, auto, train.recording)
    other = selected.preprocessing, selected.recording
    cutoff, delays = selected.preprocessing.cutoff, selected.recording.effort_delay_s
    shown = ' '.join(f'{1e3 * delay:.1f}' for delay in delays) or 'none'
    print(f'{title}: {cutoff:g} Hz, {selected.preprocessing.derivative}, delays [ms] {shown}')
    if other == usual:
        print('  the usual settings')
        return 1.0, 1.0
    before, after = (_errors(each, train, test) for each in (usual, other))
    for name, one, two in zip(('all', f'below {SLOW_HZ:g} Hz'), before, after, strict=True):
        print(f'  {name}: usual {np.round(one, 3)}, selected {np.round(two, 3)}')
    ratio = [float(np.exp(np.log(b / a).mean())) for a, b in zip(before, after, strict=True)]
    print(f'  selected / usual: {ratio[0]:.3f}, below {SLOW_HZ:g} Hz {ratio[1]:.3f}', flush=True)
    return ratio[0], ratio[1]


def _errors(settings: Settings, train: RawRecordings, test: RawRecordings) -> tuple[Array, Array]:
    """Return nMSE of unseen efforts, all of them and the slow part, shape (n,) each [%]."""
    model = fit(preprocess(train.samples, *settings))
    usual = PreprocessingSettings()
    raw = [each for one in test.samples for each in segments_of(one, usual, test.recording)[0]]
    highest = max(c for c in CUTOFFS_HZ if c < HIGHEST * min(each.rate_hz for each in raw))
    wide, slow = [], []
    for each, edge in uniform_segments(raw, usual, SLOW_HZ, REACH_S):
        inner = slice(edge, each.n_samples - edge)
        predicted = _predicted(model, each, settings)
        wide.append((target(each, highest)[inner], predicted[inner]))
        low = [low_pass(tau, each.rate_hz, SLOW_HZ)[inner] for tau in (each.effort, predicted)]
        slow.append((low[0], low[1]))
    return _nmse(wide), _nmse(slow)


def _predicted(model: InverseDynamicsModel, segment: Segment, settings: Settings) -> Array:
    """Predict the efforts at all times of a segment, each joint's as late as it was measured."""
    tau = model.predict(*smooth(segment, settings[0])[:3]).tau
    for joint, delay in enumerate(settings[1].effort_delay_s):
        earlier = np.clip(segment.t - delay, segment.t[0], segment.t[-1])
        tau[:, joint] = np.interp(earlier, segment.t, tau[:, joint])
    return tau


def _nmse(pairs: Sequence[tuple[Array, Array]]) -> Array:
    measured, predicted = (np.concatenate(each) for each in zip(*pairs, strict=True))
    return np.asarray(100.0 * np.mean((measured - predicted) ** 2, axis=0) / measured.var(axis=0))
