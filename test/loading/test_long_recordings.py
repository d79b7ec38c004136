"""Memory does not grow with the number of messages."""

from __future__ import annotations

from collections.abc import Callable
import gc
from pathlib import Path
import tracemalloc

import pytest

from benchmarks.long_recording import write
from lip_id_ros.health import evidence_of, health
from lip_id_ros.preprocessing import describe, preprocess
from lip_id_ros.recording import read_bag
from lip_id_ros.settings import PreprocessingSettings

SHORT, LONG = 30_000, 60_000
MOST_BYTES = 8.0
"""For each message: some marks of a byte; of a data set, one sample in 100 of 7 joints too."""
BOUNDS = {
    'recording.spill.LARGE_BYTES': 10_000,
    'recording.spill.BLOCK_ROWS': 1000,
    'recording.timing.MOST_STEPS': 1000,
    'preprocessing.segments.MOST_STEPS': 1000,
    'preprocessing.segments.MOST_VALUES': 1000,
    'preprocessing.sample_times.MOST_STEPS': 1000,
    'preprocessing.sample_times.BLOCK_ROWS': 1000,
    'preprocessing.sample_times.MOST_MARKS': 1000,
    'preprocessing.continuity.MOST_ROWS': 1000,
    'preprocessing.continuity.MOST_VALUES': 1000,
    'preprocessing.smoothing._WINDOW': 1000,
    'health.evidence.MOST_VALUES': 1000,
    'health.signal_checks.MOST_VALUES': 1000,
    'health.motion.MOST_SAMPLES': 6000,
}
"""Lower, so that short recordings are long beside them."""


def described(path: Path) -> object:
    return describe(path, assess=lambda samples: {'health': health(evidence_of(samples))})


def prepared(path: Path) -> object:
    settings = PreprocessingSettings(cutoff_hz=40.0, decimate=100)
    return preprocess(read_bag(path), settings)


def peak(work: Callable[[Path], object], path: Path) -> int:
    gc.collect()
    tracemalloc.start()
    try:
        work(path)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.slow
@pytest.mark.parametrize('work', [described, prepared])
def test_memory_is_that_of_a_short_recording(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, work: Callable[[Path], object]
) -> None:
    """
    Nothing but marks is held for every message.

    Stamps alone took 17 bytes for each message, and several times as much while they were judged.

    """
    for name, bound in BOUNDS.items():
        monkeypatch.setattr(f'lip_id_ros.{name}', bound)
    for name, count in (('short', SHORT), ('long', LONG)):
        write(tmp_path / name, count)
    work(tmp_path / 'short')  # imports and tables that stay
    short, long = (peak(work, tmp_path / name) for name in ('short', 'long'))
    assert (long - short) / (LONG - SHORT) < MOST_BYTES
