"""Few modules and few types hold a value on its way from a bag to a data set."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import gc
from pathlib import Path
import sys
import tracemalloc
from types import FrameType
from typing import Any

import numpy as np
import pytest
from recording.bag_files import JOINT_STATE, State, state_bytes, STEP_NS, write_mcap

import lip_id_ros
from lip_id_ros.health import evidence_of, health
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import describe, preprocess
from lip_id_ros.recording import read_bag
from lip_id_ros.recording.bag_writer import RawBag
from lip_id_ros.settings import PreprocessingSettings

MOST_MODULES = 16
HOLDERS = {'MessageBlock', 'JointSamples', 'Segment', 'Dataset'}
PACKAGE = Path(lip_id_ros.__file__).parent

NAMES = ('a', 'b', 'c', 'd', 'e')
"""So many joints that nothing else has as many columns."""


def states(count: int) -> Iterable[State]:
    phase = np.arange(len(NAMES))
    for k in range(count):
        q = np.sin(0.01 * k * (2.0 + phase) + phase).tolist()
        yield State(10**18 + k * STEP_NS, position=q, velocity=q, effort=q, names=NAMES)


def holds(value: Any, holders: set[str], depth: int = 3) -> bool:
    """Whether a value is an array of joint states, or holds one; notes the types with fields."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind == 'f' and len(NAMES) in value.shape and value.size > 100
    if depth == 0:
        return False
    names = getattr(value, '_fields', getattr(value, '__dataclass_fields__', ()))
    if names and not isinstance(value, type):
        parts = [getattr(value, name) for name in names]
        if any(holds(part, holders, 1) for part in parts):
            holders.add(type(value).__name__)
            return True
    elif isinstance(value, dict):
        parts = list(value.values())[:10]
    else:
        parts = list(value[:10]) if isinstance(value, (list, tuple)) else []
    return any(holds(part, holders, depth - 1) for part in parts)


@pytest.mark.slow
def test_few_modules_and_types_hold_a_value(tmp_path: Path) -> None:
    bag = write_mcap(tmp_path / 'bag.mcap', list(states(600)))
    modules: set[str] = set()
    holders: set[str] = set()

    def look(frame: FrameType, event: str, returned: Any) -> None:
        path = Path(frame.f_code.co_filename)
        if event == 'return' and PACKAGE in path.parents:
            found = [holds(value, holders) for value in (*frame.f_locals.values(), returned)]
            if any(found):
                modules.add(path.relative_to(PACKAGE).as_posix())

    load_dataset(bag)  # imports
    before = sys.getprofile()
    sys.setprofile(look)
    try:
        data = load_dataset(bag)
    finally:
        sys.setprofile(before)
    assert data.n_samples > 50
    assert holders == HOLDERS
    assert {'recording/joint_messages.py', 'dataset/dataset.py'} < modules
    assert len(modules) <= MOST_MODULES, sorted(modules)


SHORT, LONG = 30_000, 60_000
MOST_BYTES = 8.0
"""For each message: some marks of a byte; of a data set, one sample in 100 of 5 joints too."""
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


def write(path: Path, count: int) -> None:
    """Write joint states at 1 kHz, whose numbers are put into the bytes of one message."""
    marks = [np.full(len(NAMES), value) for value in (1.5, 2.5, 3.5)]
    q, dq, tau = (mark.tolist() for mark in marks)
    content = state_bytes(State(0, q, dq, tau, NAMES))
    message, joint = bytearray(content), np.arange(len(NAMES))
    places = [content.index(mark.tobytes()) for mark in marks]
    with RawBag(path, {'/joint_states': JOINT_STATE}) as bag:
        for k in range(count):
            message[4:12] = np.array(divmod(k * 1_000_000, 10**9), '<u4').tobytes()
            phase = 1e-3 * k * (1.0 + 0.37 * joint) + joint
            for place, values in zip(
                places, (np.sin(phase), np.cos(phase), np.sin(2.0 * phase)), strict=True
            ):
                message[place : place + values.nbytes] = values.tobytes()
            bag.write('/joint_states', k * 1_000_000, bytes(message))


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
