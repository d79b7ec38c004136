"""
Statistics of very many samples: CPU time per million and peak memory, and what they are worth.

Samples of an arm put together at random are generated block by block, so that no more than one
block is in memory. Only the statistics are timed, not the generation. 100 million samples of 4
joints: ``python -m benchmarks fleet_statistics --samples 100e6 --joints 4``.

"""

from __future__ import annotations

import argparse
from dataclasses import replace
import resource
import time

import numpy as np
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.model import FrictionModel, plain_friction
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.gathering import CHUNK, Gathering
from lip_id_ros.identification.linearisation import Linearisation, Samples
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.solution import Known, system_of
from lip_id_ros.identification.total import (
    FrictionDeviations,
    packed,
    RecordingFactors,
    Total,
)
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS, STANDARD_GRAVITY
from lip_id_ros.rigid_body.regressor import torque_regressor

MILLION = 1_000_000
NOISE = 0.1
"""Standard deviation of the noise [N m]."""

FRICTION = (0.4, 1.0, 0.1)
"""Viscous and Coulomb coefficients and offset of every joint."""


def main(arguments: list[str]) -> int:
    """Gather statistics of so many samples, and print a line for every part of them."""
    parser = argparse.ArgumentParser(prog='fleet_statistics', description=__doc__)
    parser.add_argument('--samples', type=float, default=5 * MILLION)
    parser.add_argument('--parts', type=int, default=10)
    parser.add_argument('--joints', type=int, default=7)
    args = parser.parse_args(arguments)
    with threadpool_limits(1):
        _run(round(args.samples), args.parts, args.joints)
    return 0


def _run(samples: int, parts: int, joints: int) -> None:
    around, rng = _arm(joints), np.random.default_rng(1)
    gathered = Gathering(around)
    gathered.add(Samples.of(_samples(around, rng)))
    print('samples, CPU s per million of this part, peak memory MB')
    times = []
    for part in range(parts):
        seconds, count = 0.0, 0
        while count < samples // parts:
            some = Samples.of(_samples(around, rng))
            begun = time.process_time()
            gathered.add(some)
            seconds += time.process_time() - begun
            count += len(some.q)
        times.append(seconds / count * MILLION)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        print(f'{(part + 1) * count}, {times[-1]:.2f}, {peak:.0f}', flush=True)
    print(f'slowest part over fastest: {max(times) / min(times):.3f}')
    data = _samples(around, rng)
    fitter, statistics = ArmFitter(data), gathered.statistics()
    kept = RecordingFactors(packed(statistics.factors)[None], statistics.counts[None])
    fixed = replace(Geometry.free(joints), rigid=True)
    none = FrictionDeviations.none(around.n_friction)
    known = Known(fitter.torque_std, fitter.prior, fixed)
    problem = system_of(Total(around, [kept]), known, around.noise.std, none)
    links = problem.links(problem.solved(problem.start()))
    error = torque_regressor(around.chain, data.q, data.dq, data.ddq)
    error = error @ (links - around.links).ravel()
    share = np.std(error - error.mean(axis=0)) / data.tau.std()
    print(f'error of the torques of the links: {100.0 * share:.2g} % of the torques')


def _arm(joints: int) -> Linearisation:
    """Return an arm put together at random, with plain friction."""
    rng = np.random.default_rng(0)
    chain = Chain(
        Rotation.random(joints, random_state=rng).as_matrix(),
        0.3 * rng.standard_normal((joints, 3)),
        np.zeros(joints, dtype=bool),
        np.array([0.0, 0.0, -STANDARD_GRAVITY]),
    )
    return Linearisation(
        tuple(f'joint_{k}' for k in range(joints)),
        chain,
        np.array([_link(rng) for _ in range(joints)]).reshape(-1, LINK_PARAMETERS),
        FrictionModel(plain_friction(joints, np.full(joints, 0.05)), np.tile(FRICTION, joints)),
        TorqueNoise.constant(np.full(joints, NOISE)),
    )


def _link(rng: np.random.Generator) -> Array:
    """Return the parameters of a link of 2 kg made of points about 5 cm around a centre."""
    centre, spread = 0.1 * rng.standard_normal(3), 0.05 * rng.standard_normal((10, 3))
    points, mass = centre + spread, 0.2
    squares = mass * points.T @ points
    inertia = np.trace(squares) * np.eye(3) - squares
    moments = mass * points.sum(axis=0)
    return np.concatenate([[2.0], moments, inertia[np.triu_indices(3)], [0.1]])


def _samples(around: Linearisation, rng: np.random.Generator) -> Dataset:
    """Return one block of samples at random states."""
    n = around.n_joints
    q = rng.uniform(-np.pi, np.pi, (CHUNK, n))
    dq, ddq = rng.standard_normal((CHUNK, n)), 4.0 * rng.standard_normal((CHUNK, n))
    still = Dataset.from_arrays(q, dq, ddq, np.zeros_like(q), around.joint_names)
    tau = -around.residual(still) + NOISE * rng.standard_normal(q.shape)
    return Dataset.from_arrays(q, dq, ddq, tau, around.joint_names)


if __name__ == '__main__':
    import sys

    sys.exit(main(sys.argv[1:]))
