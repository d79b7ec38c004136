"""
Real recordings that repeat themselves: each training part four times, beside the part alone.

The noise of later passes is fresh, 0.3 of the residuals; *drifting* passes begin 2 % of the part
later each. Prints a line for each split: geometric means over the joints of the errors on the
unseen part [%], alone and repeated, their ratio, and that of what is told as unexplained.

"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks._real import ARMS, RealArm, rounded, SPLITS
from benchmarks._results import by_error, Results, Row
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.identification import fit
from lip_id_ros.settings import FitSettings

PASSES, NOISE = 4, 0.3
DRIFTS = {'repeated': 0.0, 'drifting': 0.02}
"""Of the part, by which each pass begins later."""


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, and print the lines of the table."""
    parser = argparse.ArgumentParser(prog='benchmarks repetition', description=__doc__)
    parser.add_argument('data', type=Path, help='folder of the recordings')
    parser.add_argument('--results', type=Path, default=Path('repetition.json'))
    parser.add_argument('--arms', nargs='+', choices=ARMS, default=list(ARMS)[:-1])
    parser.add_argument('--splits', nargs='+', choices=SPLITS, default=list(SPLITS))
    parser.add_argument('--fits', type=int, default=1, help='of other noise, for the median')
    options = parser.parse_args(arguments)
    results = Results(options.results)
    for name, split in product(options.arms, options.splits):
        rows = {
            kind: results.row(
                f'{name}, {split} | {kind}',
                partial(_median, ARMS[name], options.data, split, DRIFTS.get(kind), options.fits),
            )
            for kind in ('alone', *DRIFTS)
        }
        print(line(f'{name}, {split}', rows), flush=True)
    return 0


def repeated(dataset: Dataset, drift: float, noise_std: Array, seed: int) -> Dataset:
    """
    Return a data set in passes, with fresh noise (n,) [N m or N] in all but the first.

    Each pass begins later by a share of the samples, and ends with those before its beginning.
    """
    rng, n = np.random.default_rng(seed), dataset.n_samples
    starts = [round(drift * k * n) for k in range(PASSES)]
    rows = np.concatenate([(np.arange(n) + start) % n for start in starts])
    wrapped = np.concatenate([np.arange(n) + start >= n for start in starts])
    turn = np.repeat(np.arange(PASSES), n) + wrapped
    duration = float(dataset.t[-1] - dataset.t[0]) + 1.0  # between passes nothing was recorded
    t = dataset.t[rows] + duration * turn + np.repeat(np.arange(PASSES), n)
    pieces = np.stack([dataset.segment[rows], np.repeat(np.arange(PASSES), n), wrapped])
    begins = np.any(np.diff(pieces, axis=1, prepend=-1) != 0, axis=0)
    noise = noise_std * rng.standard_normal((PASSES * n, noise_std.size))
    noise[:n] = 0.0
    sign, dahl = dataset.low_passed_sign, dataset.dahl_states
    return replace(
        dataset,
        t=t,
        q=dataset.q[rows],
        dq=dataset.dq[rows],
        ddq=dataset.ddq[rows],
        tau=dataset.tau[rows] + noise,
        segment=np.cumsum(begins) - 1,
        recording=np.zeros(PASSES * n, dtype=np.int64),
        low_passed_sign=None if sign is None else sign[rows],
        dahl_states=None if dahl is None else dahl[rows],
    )


def _median(arm: RealArm, data: Path, split: str, drift: float | None, count: int) -> Row:
    """
    Fit a training part, as it is or in passes, and return the fit of the median error.

    A part as it is is changed by rounding, but for seed 0.
    """
    train, test = arm.split(data, split)
    if drift is None:
        parts = [rounded(train, seed) for seed in range(count)]
    else:
        alone = fit(train, FitSettings()).predict(train.q, train.dq, train.ddq, train.t).tau
        noise_std = NOISE * np.sqrt(np.mean((train.tau - alone) ** 2, axis=0))
        parts = [repeated(train, drift, noise_std, seed) for seed in range(count)]
    return by_error([_measured(part, test) for part in parts])[(count - 1) // 2]


def _measured(train: Dataset, test: Dataset) -> Row:
    model = fit(train, FitSettings())
    return {
        'nmse': nmse_percent(model.predict(test.q, test.dq, test.ddq).tau, test.tau).tolist(),
        'unexplained': model.summary['unexplained_percent'],
        'friction': model.summary['friction'],
        'remainder': model.summary['remainder'],
    }


def line(name: str, rows: Mapping[str, Row]) -> str:
    """Return errors alone and repeated, and ratios of errors and of what is unexplained."""
    errors, unexplained = (
        {kind: float(np.exp(np.mean(np.log(row[key])))) for kind, row in rows.items()}
        for key in ('nmse', 'unexplained')
    )
    cells = [f'{each:.2g}' for each in errors.values()]
    cells += [f'{errors[kind] / errors["alone"]:.2f}' for kind in DRIFTS]
    cells += [f'{unexplained[kind] / unexplained["alone"]:.2f}' for kind in DRIFTS]
    return f'| {name} | {" | ".join(cells)} |'
