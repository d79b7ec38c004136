"""
Broken recordings without end: reading them never crashes, hangs or takes unbounded memory.

Every message of a bag that is read must be used, or counted once with a reason.

Coverage-guided by atheris where it is installed (``pip install atheris``), else by mutations of
our own: changed bytes and numbers, cuts, copies of parts to elsewhere, parts of other files.

"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
import importlib
import os
from pathlib import Path
import resource
import signal
import sys
import tempfile
import time
import traceback
from typing import Any

import numpy as np

from benchmarks._small_bags import seeds
from lip_id_ros.csv_table import CSV_SUFFIX
from lip_id_ros.dataset import DATASET_SUFFIX
from lip_id_ros.errors import LipIdError
from lip_id_ros.loading import load_dataset
from lip_id_ros.preprocessing import describe
from lip_id_ros.recording import Bag, read_bag
from lip_id_ros.recording.reading import choose_topics

MEMORY_BYTES = 2 * 2**30
CASE_S, WAITING = 10, 12
NUMBERS = (0, 1, 0x7F, 0xFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 2**40, 2**63 - 1, 2**64 - 1)

Case = tuple[str, bytes]


def main(arguments: list[str]) -> int:
    """Read broken bags until the time is up; write down what breaks the reader."""
    parser = argparse.ArgumentParser(prog='benchmarks fuzz_readers', description=__doc__)
    parser.add_argument('--minutes', type=float, default=1.0)
    parser.add_argument('--cases', type=int, default=0, help='stop after so many')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--findings', type=Path, default=Path('fuzz_findings'))
    parser.add_argument('--atheris', action='store_true', help='be guided by coverage')
    options = parser.parse_args(arguments)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    if options.atheris:
        return _guided(options)
    for each in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(each, _too_long)
    rng, files = np.random.default_rng(options.seed), seeds()
    outcomes: Counter[str] = Counter()
    ends = time.monotonic() + 60 * options.minutes
    while time.monotonic() < ends and (not options.cases or outcomes.total() < options.cases):
        outcomes[outcome(broken(rng, files), options.findings)] += 1
    print(f'{outcomes.total()} cases:', dict(outcomes.most_common()))
    return int(any(name.startswith('!') for name in outcomes))


def broken(rng: np.random.Generator, files: list[Case]) -> Case:
    """Return a file with a few things wrong."""
    suffix, content = files[rng.integers(len(files))]
    data = bytearray(content)
    for _ in range(rng.integers(1, 6)):
        if data:
            mutation = MUTATIONS[rng.integers(len(MUTATIONS))]
            mutation(rng, data, files[rng.integers(len(files))][1])
    return suffix, bytes(data)


def outcome(case: Case, findings: Path) -> str:
    """Read a file; return the outcome, which begins with ! where it is a fault."""
    suffix, data = case
    with tempfile.TemporaryDirectory(dir='/dev/shm') as folder:
        path = Path(folder) / f'bag{suffix}'
        path.write_bytes(data)
        _allow(CASE_S)
        try:
            read(path)
        except LipIdError as error:
            return type(error).__name__
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            findings.mkdir(exist_ok=True)
            name = f'{type(error).__name__}_{abs(hash(data)):x}'
            (findings / f'{name}{suffix}').write_bytes(data)
            (findings / f'{name}.txt').write_text(traceback.format_exc())
            return f'!{type(error).__name__}'
        finally:
            _allow(0)
    return 'read'


def _allow(cpu_s: float) -> None:
    """Allow so much time to compute, and more to wait, since the machine may be loaded; 0: any."""
    signal.setitimer(signal.ITIMER_PROF, cpu_s)
    signal.setitimer(signal.ITIMER_REAL, WAITING * cpu_s)


def read(path: Path) -> None:
    """Read all that can be read, and check that every message is used or counted once."""
    describe(path)
    if path.suffix in (CSV_SUFFIX, DATASET_SUFFIX):
        load_dataset(path)
        return
    samples = read_bag(path)
    with Bag(path) as bag:
        (topic,) = choose_topics(bag, '')
        stored = sum(1 for _ in bag.stored(topic.name, topic.type)) + bag.lost(topic.name)
    accounted = samples.n_samples + sum(samples.counts.values())
    if accounted != stored:
        raise AssertionError(f'{stored} messages, but {accounted} used or counted')
    arrays = (samples.t, samples.position)
    if not all(np.isfinite(array).all() for array in arrays) or (np.diff(samples.t) <= 0).any():
        raise AssertionError('samples out of order or not finite')


def _change(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    for _ in range(rng.integers(1, 4)):
        data[rng.integers(len(data))] = rng.integers(256)


def _number(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    size, place = 2 ** int(rng.integers(4)), int(rng.integers(len(data)))
    value = NUMBERS[rng.integers(len(NUMBERS))] % 256**size
    data[place : place + size] = value.to_bytes(size, 'little')


def _cut(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    del data[rng.integers(len(data)) :]


def _remove(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    start = rng.integers(len(data))
    del data[start : start + rng.integers(200)]


def _splice(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    start, place = rng.integers(len(other)), rng.integers(len(data))
    data[place:place] = other[start : start + rng.integers(2000)]


def _zeros(rng: np.random.Generator, data: bytearray, other: bytes) -> None:
    start = int(rng.integers(len(data)))
    count = min(len(data) - start, int(rng.integers(1, 600)))
    data[start : start + count] = bytes(count)


MUTATIONS: tuple[Callable[[np.random.Generator, bytearray, bytes], None], ...] = (
    _change,
    _change,
    _number,
    _number,
    _cut,
    _remove,
    _splice,
    _zeros,
)


def _too_long(signal_number: int, frame: object) -> None:
    raise TimeoutError(f'not read within {CASE_S} s')


def _guided(options: argparse.Namespace) -> int:
    atheris: Any = importlib.import_module('atheris')
    with atheris.instrument_imports(include=['lip_id_ros.recording']):
        _forget('lip_id_ros.recording')
        recording = importlib.import_module('lip_id_ros.recording')
    errors = importlib.import_module('lip_id_ros.errors')
    suffixes = sorted({suffix for suffix, _ in seeds()})

    def one(data: bytes) -> None:
        suffix = suffixes[data[0] % len(suffixes)] if data else '.mcap'
        with tempfile.TemporaryDirectory(dir='/dev/shm') as folder:
            path = Path(folder) / f'bag{suffix}'
            path.write_bytes(data[1:])
            with suppress(errors.LipIdError):
                recording.describe(path)
                recording.read_bag(path)

    options.findings.mkdir(exist_ok=True)
    corpus = options.findings / 'corpus'
    corpus.mkdir(exist_ok=True)
    for number, (suffix, data) in enumerate(seeds()):
        (corpus / f'seed{number}').write_bytes(bytes([suffixes.index(suffix)]) + data)
    flags = [
        f'-max_total_time={int(60 * options.minutes)}',
        f'-timeout={CASE_S}',
        f'-rss_limit_mb={MEMORY_BYTES // 2**20}',
        '-max_len=60000',
        '-print_final_stats=1',
        f'-artifact_prefix={options.findings}{os.sep}',
    ]
    atheris.Setup([sys.argv[0], *flags, str(corpus)], one)
    atheris.Fuzz()
    return 0


def _forget(package: str) -> None:
    for name in [name for name in sys.modules if name.startswith(package)]:
        del sys.modules[name]
