"""
Which twists and lengths fits take for simple geometry, where half of the axes have none.

Simulated Pandas; fits start at their true placements.

"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks._results import Results, Row
from benchmarks.deviations import means, MOVING, N_JOINTS, noisy, TEST_RATE_HZ, TEST_SAMPLES, Truth
from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter
from lip_id_ros.identification.friction_selection import Offer
from lip_id_ros.identification.geometry_selection import select_geometry
from lip_id_ros.identification.link_torques import links_torque
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.rigid_body import Chain

CASES = {
    'slow, 10 %': (10.0, 250, 'filtered', 0.1),
    'fast, 2 %': (100.0, 1500, 'filtered', 0.02),
    'white, 2 %': (10.0, 500, 'white', 0.02),
}
"""Rate [Hz], samples, noise and its share of each torque's deviation."""

CLOSE = 1e-6


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, and print rows of a table."""
    parser = argparse.ArgumentParser(prog='benchmarks geometry', description=__doc__)
    parser.add_argument('--cases', nargs='+', choices=tuple(CASES), default=tuple(CASES))
    parser.add_argument('--axes', nargs='+', choices=('right', 'half'), default=('right', 'half'))
    parser.add_argument('--seeds', type=int, nargs='+', default=list(range(10)))
    parser.add_argument('--results', type=Path, default=Path('geometry.json'))
    options = parser.parse_args(arguments)
    results = Results(options.results)
    for case in options.cases:
        for axes in options.axes:
            rows = [
                results.row(f'{case}, {axes}, seed {seed}', partial(measured, case, axes, seed))
                for seed in options.seeds
            ]
            print(_line(f'{case}, {axes}', rows), flush=True)
    return 0


def measured(case: str, axes: str, seed: int) -> Row:
    """Return which twists and lengths are simple and which are taken for it, and errors."""
    rate_hz, samples, noise, share = CASES[case]
    rng = np.random.default_rng(seed)
    truth = Truth(axes, rng)
    train = truth.dataset(np.arange(samples) / rate_hz, rng)
    test = truth.dataset(np.arange(TEST_SAMPLES) / TEST_RATE_HZ, rng)
    fitter = ArmFitter(noisy(train, noise, rng, share))
    usual = Offer(lambda widths, dataset: [], levers=False)  # friction is no matter of this
    free = fitter.best_start([truth.chain], fitter.selected(truth.chain, usual))
    free = fitter.refined(fitter.dataset, free)
    fit = select_geometry(fitter, free)
    twists, meetings = _simple(truth.chain)
    return {
        'twists': [twists.tolist(), (~np.isnan(fit.geometry.twists[1:])).tolist()],
        'meetings': [meetings.tolist(), fit.geometry.meets[1:].tolist()],
        'errors': _errors(fit, test).tolist(),
        'errors_free': _errors(free, test).tolist(),
    }


def _simple(chain: Chain) -> tuple[BoolArray, BoolArray]:
    """Return which axes but the first are at right angles to those before, and which meet them."""
    n, z = N_JOINTS, chain.rotations[1:, :, 2]
    quarter = Geometry(np.full(n, 0.5 * np.pi), np.zeros(n, dtype=bool))
    meeting = Geometry(np.full(n, np.nan), np.ones(n, dtype=bool))
    turned = quarter.projected(chain).rotations[1:, :, 2] - z
    moved = (meeting.projected(chain).translations - chain.translations)[1:]
    return np.linalg.norm(turned, axis=1) < CLOSE, np.linalg.norm(moved, axis=1) < CLOSE


def _errors(fit: ArmFit, test: Dataset) -> Array:
    """Return root mean squares of errors of noiseless torques in motion, (n,) [N m]."""
    load = links_torque(fit.chain, fit.links, test)
    tau = load + fit.friction.torque(test.q, test.dq, test.ddq, load, test.history)
    return np.asarray(np.sqrt(means((tau - test.tau) ** 2, np.abs(test.dq) > MOVING)))


def _line(name: str, rows: list[Row]) -> str:
    cells = [name]
    for kind in ('twists', 'meetings'):
        simple, taken = np.array([row[kind] for row in rows]).transpose(1, 0, 2)
        cells.append(f'{(simple & taken).sum()} of {simple.sum()}')
        cells.append(f'{(~simple & taken).sum()} of {(~simple).sum()}')
    logs = [np.log(np.array(row['errors']) / np.array(row['errors_free'])) for row in rows]
    return f'| {" | ".join([*cells, f"{np.exp(np.mean(logs)):.2f}"])} |'
