"""Arms learned from real recordings: M(q), the price of links that can exist, their exports."""

from __future__ import annotations

import argparse
from pathlib import Path
import shutil

import numpy as np

from benchmarks._cells import show
from benchmarks._real import ARMS, SPLITS
from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.export.arm import describe
from lip_id_ros.export.formats import FORMATS
from lip_id_ros.friction.compiled import friction_features
from lip_id_ros.identification import fit
from lip_id_ros.identification.left_out import bounded_solutions
from lip_id_ros.identification.link_torques import link_prior_std, links_torque
from lip_id_ros.identification.statistics import triangular
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body.regressor import torque_regressor

POSITIONS, STATES = 100_000, 10_000
FRICTION_STD = 10.0
"""Of the coefficients of the unconstrained fit a priori, in the torques' standard deviations."""
COLUMNS = {
    'arm': 'recording, unseen',
    'smallest': f'smallest eigenvalue of M at {POSITIONS} q',
    'condition': 'median condition of M',
    'links': 'error / any links, the same friction',
    'links_worst': 'at the worst joint',
    'both': 'error / any links and friction',
    'both_worst': 'at the worst joint ',
    **{name: name for name in FORMATS},
}


def main(arguments: list[str]) -> int:
    """Fit, measure, print a table; exit status 1 where an M(q) is not positive definite."""
    parser = argparse.ArgumentParser(prog='benchmarks feasible', description=__doc__)
    parser.add_argument('data', type=Path, help='folder of the recordings')
    parser.add_argument('--arms', nargs='+', choices=ARMS, default=list(ARMS))
    parser.add_argument('--splits', nargs='+', choices=SPLITS, default=list(SPLITS[:1]))
    options = parser.parse_args(arguments)
    rows, indefinite = [], False
    for name in options.arms:
        for split in options.splits:
            training, unseen = ARMS[name].split(options.data, split)
            model = fit(training)
            eigenvalues = _eigenvalues(model)
            indefinite |= bool(eigenvalues[:, 0].min() <= 0.0)
            links, both = _prices(model, training, unseen)
            row = {
                'arm': f'{name}, {split}',
                'smallest': f'{eigenvalues[:, 0].min():.2g}',
                'condition': f'{np.median(eigenvalues[:, -1] / eigenvalues[:, 0]):.2g}',
                'links': f'{np.exp(np.log(links).mean()):.3f}',
                'links_worst': f'{links.max():.2f}',
                'both': f'{np.exp(np.log(both).mean()):.3f}',
                'both_worst': f'{both.max():.2f}',
                **_agreements(model),
            }
            print(row, flush=True)
            rows.append(row)
    show('Arms of real recordings', COLUMNS, rows, 160)
    return int(indefinite)


def _eigenvalues(model: InverseDynamicsModel) -> Array:
    """Return those of M(q) in ascending order: whole turns, and the range of prismatic joints."""
    low, high = (each[0].copy() for each in model.training_range)
    turns = np.array(model.joint_types) == 'revolute'
    low[turns], high[turns] = -np.pi, np.pi
    q = np.random.default_rng(0).uniform(low, high, (POSITIONS, len(low)))
    return np.linalg.eigvalsh(model.inertia_matrix(q))


def _prices(
    model: InverseDynamicsModel, training: Dataset, unseen: Dataset
) -> tuple[Array, Array]:
    """Return errors of links and friction in those of links, and of both, without constraints."""
    arm = model.arm
    assert arm is not None, 'the default fit of so many samples is an arm'
    rows, prior = _weighted_rows(arm, training)
    bounded = np.flatnonzero(arm.friction.basis.is_positive) + arm.links.size
    features, own = _features(arm, unseen), arm.torque(unseen.q, unseen.dq, unseen.ddq)
    errors = [
        nmse_percent(features @ (prior * _least_squares(rows, some)), unseen.tau)
        for some in (bounded, bounded[:0])
    ]
    mine = nmse_percent(own, unseen.tau)
    return np.asarray(mine / errors[0]), np.asarray(mine / errors[1])


def _weighted_rows(arm: ArmPosterior, data: Dataset) -> tuple[Array, Array]:
    """
    Return the triangular factor of [features, torques] and prior, and the prior's deviations.

    Rows are in units of the residuals of the arm, parameters in units of their deviations a
    priori; placements and friction terms are those of the arm.

    """
    features, near_rest = _features(arm, data), arm.noise.weights(data.dq)
    squares = near_rest * (data.tau - arm.torque(data.q, data.dq, data.ddq)) ** 2
    weights = np.sqrt(near_rest / squares.mean(axis=0))
    friction = FRICTION_STD * data.tau.std(axis=0).max() * np.ones(arm.friction.basis.size)
    prior = np.concatenate([link_prior_std(data).ravel(), friction])
    rows = np.concatenate([features * prior, data.tau[..., None]], axis=2) * weights[..., None]
    return triangular(rows.reshape(-1, prior.size + 1), np.eye(prior.size, prior.size + 1)), prior


def _least_squares(rows: Array, bounded: IndexArray) -> Array:
    """Return the parameters that fit best, of which some are not negative."""
    normal, is_bounded = rows.T @ rows, np.zeros(rows.shape[1] - 1, dtype=np.bool_)
    is_bounded[bounded] = True
    return bounded_solutions(normal[:-1, :-1], normal[:-1, -1], is_bounded)


def _features(arm: ArmPosterior, data: Dataset) -> Array:
    state = [np.ascontiguousarray(x) for x in (data.q, data.dq, data.ddq)]
    load = links_torque(arm.chain, arm.links, data)
    friction = friction_features(arm.friction.basis, data.q, data.dq, data.ddq, load)
    return np.concatenate([torque_regressor(arm.chain, *state), friction], axis=2)


def _agreements(model: InverseDynamicsModel) -> dict[str, str]:
    """Return how far other readers of the exported links and friction differ from the model."""
    arm = describe(model, 'arm').arm
    states = arm.ranges.random_states(STATES, np.random.default_rng(0))
    own = model.arm if model.arm is not None and model.residual_gp is not None else None
    tau = model.predict(*states).tau if own is None else own.torque(*states)
    return {
        name: f'{form.check(form.text(arm), arm, tau, states).difference.max():.0e}'
        for name, form in FORMATS.items()
        if name != 'c' or shutil.which('cc')
    }
