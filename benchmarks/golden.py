"""
Golden figures: what the package did before it was rebuilt, to hold a rewrite against.

Fits, selections, deviations, payloads and followed arms are the same to the digit where the code
computes the same; latencies and sizes are shown side by side. `test/golden_figures.json` has them.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from functools import partial
import json
from pathlib import Path
import time

import numpy as np

from benchmarks import follow_real, panda_monte_carlo, payload_events
from benchmarks._panda import run_pair
from benchmarks._real import ARMS, rounded, SPLITS
from benchmarks._results import by_error, geometric_mean, Results, Row
from benchmarks._zoo import load_arm, recorded, ZOO
from benchmarks.deviations import measured as deviations_of
from lip_id_ros import identification
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.preprocessing import for_training
from lip_id_ros.settings import FitSettings, PreprocessingSettings
from lip_id_ros.simulation.arm import panda_urdf

ROOT = Path(__file__).resolve().parents[1]
GOLDEN = ROOT / 'test' / 'golden_figures.json'
FITS = 5
"""Of torques that differ by rounding; the median of their geometric means is shown."""

ZOO_ARMS = 'UR5', 'xArm7', 'TIAGo Pro', 'TIAGo, torso'
FOLLOWED = 'UR3', 'KUKA LWR'
MONTE_CARLO = (6, 7), range(3)
EVENTS = 8
OTHER_EVERY_TIME = 'latency', 'size'
"""First words of rows that are not compared to the digit."""

Measure = Callable[[], Row]


def main(arguments: list[str]) -> int:
    """Measure what the file lacks; exit status 1 where a figure differs from the golden one."""
    parser = argparse.ArgumentParser(prog='benchmarks golden', description=__doc__)
    parser.add_argument('data', type=Path, help='folder of the real recordings')
    parser.add_argument('--results', type=Path, default=Path('golden.json'))
    parser.add_argument('--only', default='', help='rows whose names begin so')
    parser.add_argument('--against', type=Path, default=GOLDEN)
    options = parser.parse_args(arguments)
    results = Results(options.results)
    named = [each for each in rows(options.data) if each[0].startswith(options.only)]
    for name, measure in named:
        results.row(name, measure)
    if not options.against.exists():
        return 0
    golden = json.loads(options.against.read_text())
    return show({name: results.rows[name] for name, _ in named}, golden)


def rows(data: Path) -> Iterator[tuple[str, Measure]]:
    """Yield each row by its name."""
    for name in ARMS:
        for split in SPLITS:
            yield f'real, {name}, {split}', partial(real, data, name, split)
    for name in ZOO_ARMS:
        yield f'zoo, {name}', partial(zoo, name)
    for joints in MONTE_CARLO[0]:
        for seed in MONTE_CARLO[1]:
            yield f'Monte Carlo, {joints} joints, {seed}', partial(monte_carlo, joints, seed)
    for noise in ('white', 'filtered'):
        for axes in ('right', 'askew'):
            yield f'deviations, {noise}, {axes}', partial(deviations, noise, axes)
    yield 'payload events', lambda: {'events': payload_events.figures(0, EVENTS)}
    for name in FOLLOWED:
        yield f'adapt, {name}', partial(followed, data, name)
    yield 'latency, in queries of torques', latency
    yield 'size, modules and lines', sizes


def real(data: Path, name: str, split: str) -> Row:
    """Return the median of five fits of a recording, and their spread."""
    return median(*ARMS[name].split(data, split))


def zoo(name: str) -> Row:
    """Return the median of five fits of a simulated arm, and their spread."""
    arm = ZOO[name]
    recording = recorded(
        load_arm(panda_urdf().parents[2] / arm.urdf, arm.first, arm.last), 'random', 0
    )
    return median(recording.train, recording.test)


def median(train: Dataset, test: Dataset) -> Row:
    """Return the fit of the median error, and the lowest and the highest geometric mean."""
    found = by_error([fitted(rounded(train, seed), test) for seed in range(FITS)])
    spread = [geometric_mean(found[0]), geometric_mean(found[-1])]
    return {**found[(FITS - 1) // 2], 'spread': spread}


def fitted(train: Dataset, test: Dataset) -> Row:
    """Return errors, selections and mean deviations of one fit."""
    train = for_training(train, PreprocessingSettings(), 'articulated')
    model = identification.fit(train, FitSettings())
    found = model.predict(test.q, test.dq, test.ddq, return_std=True)
    assert found.std is not None
    within = np.abs(found.tau - test.tau) < 2.0 * found.std.measurement
    return {
        'nmse': nmse_percent(found.tau, test.tau).tolist(),
        'within_two_std': np.mean(within, axis=0).tolist(),
        'std_tau': np.sqrt(np.mean(found.std.tau**2, axis=0)).tolist(),
        'selected': {key: model.summary.get(key) for key in ('friction', 'remainder')},
    }


def monte_carlo(joints: int, seed: int) -> Row:
    """Return errors of the default on one run of the paper's experiment."""
    row = panda_monte_carlo.measured(joints, seed, 'articulated', [])
    return without_cpu(row)


def deviations(noise: str, axes: str) -> Row:
    """Return coverage and size of deviations of one fit."""
    return without_cpu(deviations_of(2000, noise, axes, 0))


def followed(data: Path, name: str) -> Row:
    """Return errors of a real arm that is followed."""
    lines = follow_real.follow(name, *follow_real.recordings(name, data))
    return {'lines': [without_cpu(line) for line in lines]}


def without_cpu(row: Row) -> Row:
    """Return a row without its times."""
    return {key: value for key, value in row.items() if key not in ('cpu_s', 'us_per_sample')}


def latency() -> Row:
    """Return least times of one state, in those of its torques and energies alone."""
    train, _ = run_pair(7, 0)
    model = identification.fit(train, FitSettings())
    one = [each[0] for each in (train.q, train.dq, train.ddq)]
    many = [each[:1] for each in (train.q, train.dq, train.ddq)]
    calls: dict[str, Callable[[], object]] = {
        'query': lambda: model.query(*one),
        'predict': lambda: model.predict(*many),
        'with deviations': lambda: model.predict(*many, return_std=True),
    }
    seconds = {name: least(call) for name, call in calls.items()}
    return {name: round(each / seconds['query'], 1) for name, each in seconds.items()}


def least(call: Callable[[], object], count: int = 2000) -> float:
    """Return the least time of some calls [s]."""
    times = []
    for _ in range(count):
        begun = time.perf_counter()
        call()
        times.append(time.perf_counter() - begun)
    return min(times)


def sizes() -> Row:
    """Return modules and lines of each room, and of tests and benchmarks."""
    places = [each for each in sorted((ROOT / 'lip_id_ros').iterdir()) if each.is_dir()]
    found = {}
    for place in [*places, *(ROOT / name for name in ('lip_id_ros', 'benchmarks', 'test'))]:
        files = list(place.rglob('*.py'))
        if files:
            found[place.name] = [len(files), sum(len(f.read_text().splitlines()) for f in files)]
    return found


def show(found: dict[str, Row], golden: dict[str, Row]) -> int:
    """Print what differs; return 1 where a figure does that should not."""
    wrong = 0
    for name, row in found.items():
        same = as_text(row) == as_text(golden.get(name))
        print(f'{"equal  " if same else "DIFFERS"} {name}')
        if not same:
            print(f'  golden {as_text(golden.get(name))}\n  now    {as_text(row)}')
            wrong += not name.startswith(OTHER_EVERY_TIME)
    return int(wrong > 0)


def as_text(row: Row | None) -> str:
    """Return a row as it stands in a file; a number that is none equals itself there."""
    return json.dumps(row, sort_keys=True)
