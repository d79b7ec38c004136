"""Fit several models to the same recordings and evaluate them on the same unseen motion."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from functools import partial
import hashlib
import json
from pathlib import Path
import time
from typing import Any

import numpy as np

from benchmarks._results import Results, Row
from benchmarks.baselines import Method, method, MODELS
from lip_id_ros.cli import arguments, models, output
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError, FitError
from lip_id_ros.evaluation import evaluate, matched
from lip_id_ros.evaluation.tables import percent, show, show_lines, Table
from lip_id_ros.loading import load_dataset, with_selected
from lip_id_ros.model import TorqueModel
from lip_id_ros.preprocessing import for_training
from lip_id_ros.progress import Progress
from lip_id_ros.settings import Config, FitSettings

DEFAULT_MODELS = 'se,gip,lip,recursive,articulated'
QUERIES = 50
MEANS = {
    'mean': 'nmse_percent_mean',
    'kinetic': 'kinetic_nmse_percent',
    'potential': 'potential_nmse_percent',
}
EPILOG = """\
examples (python -m benchmarks compare_models ...):
  my_bag                                   the last 30 % are the unseen motion
  run1.mcap run2.mcap --test run3.mcap run4.mcap
  my_bag --models articulated,rigid_body --urdf arm.urdf
  my_bag --samples 50,100,200,400          error against number of samples
"""

Tests = Mapping[str, Dataset]


def main(given: list[str]) -> int:
    """Fit what is not in the file of results yet, and print tables for each number of samples."""
    args = _options(given)
    config = models.chosen_config(
        args.config, {'recording.joints': args.joints, 'fit.seed': args.seed}
    )
    methods = {name: method(name, args.urdf) for name in args.models}
    results, console = Results(args.results), output.console()
    with output.progress_display() as progress:
        train, tests = _data(args, config, progress)
        key = _digest(train, tests, config.fit, args.urdf)
        for count in args.samples or (train.n_samples,):
            some, rows = thinned(train, count), {}
            for name, each in methods.items():
                measure = partial(measured, each, some, tests, config.fit, progress)
                rows[name] = results.row(f'{count} samples | {name} | {key}', measure)
            for table in tables(f'{count} samples', rows):
                show(table, console)
            failed = [f'{name}: {row["error"]}' for name, row in rows.items() if 'error' in row]
            show_lines(failed, console)
    return 0


def _options(given: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='benchmarks compare_models',
        description=__doc__,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    arguments.add_sources(parser)
    chosen = f'of {", ".join(MODELS)} (default: {DEFAULT_MODELS})'
    parser.add_argument(
        '--models', type=arguments.joint_names, default=DEFAULT_MODELS, help=chosen
    )
    unseen = parser.add_mutually_exclusive_group()
    share = 'of the samples, the first in time, for training (default: 0.7)'
    unseen.add_argument('--train-share', type=arguments.share, default=0.7, help=share)
    unseen.add_argument('--test', nargs='+', metavar='SOURCE', help='unseen motions, one by one')
    count = 'numbers of training samples, evenly spaced (default: all)'
    parser.add_argument('--samples', type=_counts, metavar='N,M,...', help=count)
    parser.add_argument('--urdf', type=arguments.source, metavar='FILE', help='robot description')
    parser.add_argument('--results', type=Path, default=Path('compare_models.json'))
    arguments.add_config(parser, 'default settings')
    arguments.add_joints(parser)
    arguments.add_seed(parser)
    return parser.parse_args(given)


def _data(args: argparse.Namespace, config: Config, progress: Progress) -> tuple[Dataset, Tests]:
    """Load samples for training, and unseen motions by name."""
    share = 1.0 if args.test else args.train_share
    train = load_dataset(args.sources, config, progress, training_share=share)
    if args.test:
        same = with_selected(config, train.provenance)
        same = replace(same, recording=replace(same.recording, joints=train.joint_names))
        tests = {
            source: matched(load_dataset([source], same, progress), train) for source in args.test
        }
    else:
        train, rest = train.split(share)
        tests = {f'the last {100 * (1 - share):g} %': rest}
    return for_training(train, config.preprocessing, config.fit.kernel), tests


def _digest(train: Dataset, tests: Tests, settings: FitSettings, urdf: str | None) -> str:
    parts = [each.digest() for each in (train, *tests.values())]
    text = '' if urdf is None else Path(urdf).read_text(encoding='utf-8')
    key = json.dumps([parts, list(tests), asdict(settings), text], sort_keys=True)
    return hashlib.sha256(key.encode()).hexdigest()[:8]


def thinned(dataset: Dataset, count: int) -> Dataset:
    """Return `count` evenly spaced samples, or all where there are fewer."""
    if count >= dataset.n_samples:
        return dataset
    return dataset.select(np.linspace(0, dataset.n_samples - 1, count).round().astype(np.int64))


def measured(
    chosen: Method, train: Dataset, tests: Tests, settings: FitSettings, progress: Progress
) -> Row:
    """Fit a model; return its cost, and its evaluation on each unseen motion."""
    started = time.perf_counter()
    try:
        fitted = chosen.fit(train, settings, progress)
    except (DataError, FitError) as error:
        return {'error': str(error)}
    seconds = time.perf_counter() - started
    return {
        'fit_seconds': seconds,
        'query_us': _query_us(fitted, train),
        'size': fitted.size,
        'motions': {name: evaluate(fitted, test).to_json() for name, test in tests.items()},
    }


def _query_us(model: TorqueModel, data: Dataset) -> float:
    """Return the median time of the prediction of one sample [microseconds]."""
    times = []
    for row in range(min(QUERIES, data.n_samples)):
        one, started = slice(row, row + 1), time.perf_counter()
        model.predict(data.q[one], data.dq[one], data.ddq[one])
        times.append(time.perf_counter() - started)
    return 1e6 * float(np.median(times))


def tables(title: str, rows: Mapping[str, Row]) -> Iterator[Table]:
    """Yield the medians of errors over unseen motions, those near rest, and costs of models."""
    known = {model: row['motions'] for model, row in rows.items() if 'error' not in row}
    if not known:
        return
    motions = next(iter(known.values()))
    joints = next(iter(motions.values()))['joint_names']
    errors, rest = [], []
    for model, found in known.items():
        means = [medians(found, key) for key in MEANS.values()]
        errors.append((model, *map(percent, [*medians(found, 'nmse_percent'), *means])))
        parts = (medians(found, f'rmse_{name}') for name in ('in_motion', 'near_rest'))
        rest.append((model, *(f'{x:.3g}, {y:.3g}' for x, y in zip(*parts, strict=True))))
    of = 'one unseen motion' if len(motions) == 1 else f'medians of {len(motions)} unseen motions'
    yield Table(f'{title}: nMSE [%], {of}', ('model', *joints, *MEANS), errors)
    yield Table(f'{title}: RMSE in motion, near rest [N m or N]', ('model', *joints), rest)
    costs = [
        (m, f'{row["fit_seconds"]:.3g}', f'{row["query_us"]:.0f}', f'{row["size"]}')
        for m, row in rows.items()
        if m in known
    ]
    yield Table(f'{title}: cost', ('model', 'fit [s]', 'one query [us]', 'numbers kept'), costs)


def medians(motions: Mapping[str, Any], name: str) -> Any:
    """Return medians over the motions of a figure, joint by joint where it has joints."""
    return np.median(np.array([each[name] for each in motions.values()], float), axis=0)


def _counts(text: str) -> tuple[int, ...]:
    """Read whole numbers above zero, separated by commas; return them in rising order."""
    return tuple(sorted({arguments.count(part.strip()) for part in text.split(',')}))
