"""
Whether standard deviations of torques are true: coverage of noiseless torques, and mean size.

Errors are compared with their limit too: the expected error of least squares that begins at the
true arm, with places of joints, links and friction unknown, and white noise (Cramer and Rao).

Fits to a simulated Panda with viscous and Coulomb friction, evaluated on another motion. Its axes
are as they are, or askew by a degree or so, so that no simple geometry is right.

"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
import time

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from benchmarks._cells import show
from benchmarks._panda import half_ranges
from benchmarks._results import Results, Row
from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.urdf import load_description
from lip_id_ros.identification.identify import identify
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.rnea_derivatives import placement_derivatives
from lip_id_ros.simulation import SinusoidTrajectory
from lip_id_ros.simulation.arm import panda_urdf

N_JOINTS, RATE_HZ = 7, 100.0
NAMES = tuple(f'panda_joint{i + 1}' for i in range(N_JOINTS))
TYPES = ('revolute',) * N_JOINTS
VISCOUS, COULOMB, WIDTH = 0.5, 0.8, 0.02
NOISE = 0.02
"""Of each torque's deviation."""

CORRELATED = 2.0
"""Deviation of the filter of correlated noise, in samples."""

ASKEW = np.radians(1.0)
"""Deviation of axes from where they are."""

TEST_SAMPLES, TEST_RATE_HZ, MOVING = 2000, 40.0, 0.1
"""The motion of the test, and the velocity [rad/s] below which friction is not judged."""

LIMIT_SAMPLES, RANK = 20_000, 1e-7
"""At most, from which the limit is computed, and least singular value of what is identified."""

COLUMNS = {
    'fits': 'samples, noise, axes',
    'within': 'within [%]',
    'ratio': 'deviation over error',
    'of_limit': 'error over limit',
    'cpu_s': 'CPU [s]',
}


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, and print rows of a table."""
    parser = argparse.ArgumentParser(prog='benchmarks deviations', description=__doc__)
    parser.add_argument('--samples', type=int, nargs='+', default=[500, 2000, 10_000])
    parser.add_argument('--seeds', type=int, nargs='+', default=list(range(5)))
    parser.add_argument('--noise', nargs='+', choices=('white', 'filtered'), default=['white'])
    parser.add_argument('--axes', nargs='+', choices=('right', 'askew'), default=['right'])
    parser.add_argument('--results', type=Path, default=Path('deviations.json'))
    options = parser.parse_args(arguments)
    results, table = Results(options.results), []
    for samples, noise, axes in product(options.samples, options.noise, options.axes):
        rows = []
        for seed in options.seeds:
            measure = partial(measured, samples, noise, axes, seed)
            rows.append(results.row(f'{samples}, {noise}, {axes}, seed {seed}', measure))
        within, of_limit, cpu_s = (
            np.mean([row[name] for row in rows], axis=0)
            for name in ('within', 'of_limit', 'cpu_s')
        )
        ratio = pooled(np.array([row['ratio'] for row in rows]))
        table.append(
            {
                'fits': f'{samples}, {noise}, {axes}',
                'within': ' '.join(f'{100.0 * x:.0f}' for x in within),
                'ratio': ' '.join(f'{x:.2f}' for x in ratio),
                'of_limit': ' '.join(f'{x:.2f}' for x in of_limit),
                'cpu_s': f'{cpu_s:.0f}',
            }
        )
    show('noiseless torques within two deviations, joint by joint', COLUMNS, table, 140)
    return 0


def measured(samples: int, noise: str, axes: str, seed: int) -> Row:
    """Return coverage and mean deviation over error of one fit, joint by joint."""
    rng = np.random.default_rng(seed)
    torque = Truth(axes, rng)
    train = torque.dataset(np.arange(samples) / RATE_HZ, rng)
    test = torque.dataset(np.arange(TEST_SAMPLES) / TEST_RATE_HZ, rng)
    started = time.process_time()
    found = identify(noisy(train, noise, rng))
    cpu_s = time.process_time() - started
    state = test.q, test.dq, test.ddq
    error, std = found.arm.torque(*state) - test.tau, found.arm.torque_std(*state)
    moving = np.abs(test.dq) > MOVING
    inside = means(np.abs(error) < 2.0 * std, moving)
    ratio = np.sqrt(means(std**2, moving) / means(error**2, moving))
    return {
        'within': inside.tolist(),
        'ratio': ratio.tolist(),
        'of_limit': (
            np.sqrt(means(error**2, moving)) / torque.limit(train, test, moving)
        ).tolist(),
        'inflation': found.solution.inflation,
        'cpu_s': cpu_s,
    }


def pooled(ratios: Array) -> Array:
    """
    Return deviation over error of several fits, (K, n), by the mean square of the inverse, (n,).

    That is 1 where deviations are true. The mean of the ratios is not: the few independent errors
    of a fit are all small now and then, and three of them make it 1.38.
    """
    return np.asarray(1.0 / np.sqrt(np.mean(ratios**-2.0, axis=0)))


def noisy(dataset: Dataset, noise: str, rng: np.random.Generator) -> Dataset:
    """Add errors to torques, as a share of each one's deviation: white, or filtered."""
    errors = rng.standard_normal(dataset.tau.shape)
    if noise == 'filtered':
        errors = gaussian_filter1d(errors, CORRELATED, axis=0)
        errors /= errors.std(axis=0)
    return replace(dataset, tau=dataset.tau + NOISE * dataset.tau.std(axis=0) * errors)


class Truth:
    """A Panda with friction, whose axes are right or askew."""

    def __init__(self, axes: str, rng: np.random.Generator) -> None:
        panda = load_description(panda_urdf(), NAMES, TYPES)
        turns = Rotation.from_rotvec(ASKEW * rng.standard_normal((N_JOINTS, 3))).as_matrix()
        chain, self._links = panda.chain, panda.links
        rotations = chain.rotations @ (turns if axes == 'askew' else np.eye(3))
        self.chain = chain._replace(rotations=rotations)

    def dataset(self, t: Array, rng: np.random.Generator) -> Dataset:
        """Return noiseless samples of a random motion."""
        motion = SinusoidTrajectory.random(half_ranges(N_JOINTS), rng).sample(t)
        dq = motion[1]
        tau = torque_regressor(self.chain, *motion) @ self._links.ravel()
        tau = tau + VISCOUS * dq + COULOMB * np.tanh(dq / WIDTH)
        return Dataset.from_arrays(*motion, tau, NAMES, TYPES, t)

    def limit(self, train: Dataset, test: Dataset, where: BoolArray) -> Array:
        """Return the expected error of each joint's torque at some samples, shape (n,) [N m]."""
        std = NOISE * train.tau.std(axis=0)[:, None]
        thinned = train.select(np.arange(0, train.n_samples, 1 + train.n_samples // LIMIT_SAMPLES))
        rows = (self._slopes(thinned) / std).reshape(N_JOINTS * thinned.n_samples, -1)
        rows *= np.sqrt(train.n_samples / thinned.n_samples)
        size = np.linalg.norm(rows, axis=0)
        known = size > 0.0
        _, singular, right = np.linalg.svd(rows[:, known] / size[known], full_matrices=False)
        used = singular > RANK * singular[0]
        root = right[used].T / singular[used] / size[known, None]
        errors = self._slopes(test)[..., known] @ root
        return np.sqrt(means(np.sum(errors**2, axis=2), where))

    def _slopes(self, data: Dataset) -> Array:
        """Return slopes of torques by places of joints, links and friction, (N, n, p)."""
        state = data.q, data.dq, data.ddq
        places = placement_derivatives(self.chain, self._links, *state)
        features = data.dq, np.tanh(data.dq / WIDTH), np.ones_like(data.dq)
        friction = [each[:, :, None] * np.eye(N_JOINTS) for each in features]
        flat = places.reshape(data.n_samples, N_JOINTS, -1)
        return np.concatenate([flat, torque_regressor(self.chain, *state), *friction], axis=2)


def means(values: Array | BoolArray, where: BoolArray) -> Array:
    """Return the mean of each column where a mask is true."""
    return np.asarray(np.sum(values * where, axis=0) / np.sum(where, axis=0))
