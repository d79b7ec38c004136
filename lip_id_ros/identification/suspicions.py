"""
Causes of large residuals.

Drifts, changing payloads, a moving base, scales (health.md). Changes are compared with what the
same features of other times explain, since any features explain residuals that last.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.disturbances import MOST_SAMPLES, time_blocks
from lip_id_ros.identification.effort_scale import (
    alike,
    find_effort_scale,
    fit_scale,
    left_by_revolutions,
)
from lip_id_ros.identification.linear_problem import LinearProblem
from lip_id_ros.identification.placement_search import Calibration
from lip_id_ros.progress import Progress
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor import torque_regressor

LEAST_SAMPLES = 200

LEAST_DRIFT = 6.0
"""Standard errors."""

LONGEST_LAG = 60
"""Samples over which residuals are correlated."""

BASE_EXCESS, PAYLOAD_EXCESS = 0.3, 0.45
"""
Least decrease of the logarithm of mean squares beyond that by features of other times: the mean
over joints where gravity turns from block to block, the largest of a joint where the last link
gets another mass and centre of mass.
"""

SHIFTS = 0.2, 0.37, 0.55, 0.71
"""Other times, as shares of the samples from each."""

SCALE_GAIN, SCALE_HINT = 2.0, 1.3
"""Factors of residuals, the second at which placements are searched for again."""

RIDGE = 1e-6


def suspicions(
    search: ArmSearch, calibration: Calibration, seed: int, progress: Progress
) -> list[str]:
    """Return a sentence for each cause that explains the residuals far better than chance."""
    dataset = search.fitter.dataset
    rows = np.linspace(0, dataset.n_samples - 1, min(MOST_SAMPLES, dataset.n_samples)).astype(int)
    if rows.size < LEAST_SAMPLES:
        return []
    left = left_by_revolutions(search, calibration, seed, progress)
    if left is not None:
        return [
            f'Positions seem to be in revolutions: read so, they leave {100.0 * left:.2g} % of '
            'the residuals that they leave as rad; publish them in rad.'
        ]
    block = np.unique(time_blocks(dataset)[rows], return_inverse=True)[1]
    problem = LinearProblem.of(search, calibration, rows, block)
    some = dataset.select(rows)
    scales = _scales(search, calibration, some, seed, progress)
    texts = [*scales, *_drifts(some, problem, calibration.noise_std)]
    return texts or list(_blocks(search, calibration, some, problem))


def _scales(
    search: ArmSearch, calibration: Calibration, some: Dataset, seed: int, progress: Progress
) -> Iterator[str]:
    """Let each joint have a scale, and search for the placements again where that helps."""
    chain, link_std = calibration.placements.chain, search.fitter.link_std
    one, free = fit_scale(some, chain, link_std, 1), fit_scale(some, chain, link_std)
    if alike(free.scale) or free.mean_residual * SCALE_HINT > one.mean_residual:
        return
    if free.mean_residual * SCALE_GAIN > one.mean_residual:
        free = find_effort_scale(some, one, seed, progress)
    left = free.mean_residual / one.mean_residual
    if left * SCALE_GAIN < 1.0 and not alike(free.scale):
        yield (
            f'With a scale of its own for the efforts of each joint, links leave {100 * left:.2g} '
            '% of the residuals: efforts seem to be motor currents or percent of a rating; see '
            'lip_id inspect --efforts, and give recording.effort_scale.'
        )


def _drifts(some: Dataset, problem: LinearProblem, noise_std: Array) -> Iterator[str]:
    """Regress torques on the time since the middle of each recording too."""
    time = some.t.copy()
    for number in np.unique(some.recording):
        time[some.recording == number] -= time[some.recording == number].mean()
    duration = float(np.ptp(time))
    _, std = problem.solved()
    n, k = len(std), problem.features.shape[2]
    size = np.sqrt(problem.weights.mean(axis=0))
    scale = np.sqrt(problem.weights) / size
    trend = (time[:, None] / max(duration, 1e-9) * scale)[..., None] * np.eye(n)
    columns = np.concatenate([problem.features / std[:, None], trend], axis=2)
    matrix, torque = columns.reshape(-1, k + n), (problem.torque / std).ravel()
    inverse = np.linalg.inv(matrix.T @ matrix + np.eye(k + n))
    found = inverse @ (matrix.T @ torque)
    residual = (torque - matrix @ found).reshape(-1, n)
    error = np.sqrt(np.diag(inverse)[k:] * np.mean(residual**2, axis=0) * _inflation(residual))
    sure = np.abs(found[k:] / error) > LEAST_DRIFT
    if sure.any():
        change = (found[k:] * std * noise_std / size)[sure]
        names = np.array(some.joint_names)[sure]
        parts = [f'{name} {value:+.2g}' for name, value in zip(names, change, strict=True)]
        yield (
            f'Offsets of efforts drift within {duration:.3g} s: {", ".join(parts)} N m or N; let '
            'sensors and drives warm up, or fit shorter recordings apart.'
        )


def _inflation(residual: Array) -> Array:
    """Return by how much correlation in time raises the variance of a mean, (n,)."""
    centred = residual - residual.mean(axis=0)
    products = [
        np.sum(centred[lag:] * centred[: len(centred) - lag], axis=0)
        for lag in range(min(LONGEST_LAG, len(centred)))
    ]
    correlation = np.array(products) / products[0]
    return 1.0 + 2.0 * np.maximum(np.cumsum(correlation[1:], axis=0).max(axis=0), 0.0)


def _blocks(
    search: ArmSearch, calibration: Calibration, some: Dataset, problem: LinearProblem
) -> Iterator[str]:
    """Ask whether gravity or the last link differs between blocks of half a second."""
    if some.n_joints < 2:  # gravity explains any torque that lasts
        return
    parameters, std = problem.solved()
    residual = (problem.torque - problem.features @ parameters) / std
    last = problem.features.shape[2] - search.samples(some.select(np.arange(1))).friction_std.size
    body = problem.features[:, :, last - LINK_PARAMETERS : last - LINK_PARAMETERS + 4]
    body = body / std[:, None]
    # a payload lasts: that of the blocks beside, which the motion of a block cannot mimic
    payload, of_payload = _gains(body, residual, problem.block, _beside)
    gravity = _gravity(search, calibration, some, parameters[:last])
    scale = np.sqrt(problem.weights) / (calibration.noise_std * std)
    gravity *= scale[..., None]
    base, of_base = (np.mean(each) for each in _gains(gravity, residual, problem.block))
    is_base = of_base >= of_payload.mean()  # with fewer parameters
    if is_base and of_base > BASE_EXCESS:
        yield (
            f'A base that tilts from one half second to the next explains {_share(base)} % of the '
            'residuals of all joints: fix the base. Other efforts that change in time may look '
            'alike.'
        )
    elif not is_base and of_payload.max() > PAYLOAD_EXCESS:
        joint = int(np.argmax(of_payload))
        yield (
            f'A last link that changes its mass from one half second to the next explains '
            f'{_share(payload[joint])} % of the residuals of {some.joint_names[joint]}: a payload '
            'that was taken up and put down, which cannot be told from contact, nor from other '
            'torques that last; fit what was recorded with and without it apart.'
        )


def _share(gain: float) -> str:
    return f'{100.0 * (1.0 - np.exp(-gain)):.2g}'


def _gravity(
    search: ArmSearch, calibration: Calibration, some: Dataset, parameters: Array
) -> Array:
    """Return the torques of a unit of gravity in the two directions across it, (N, n, 2)."""
    chain = calibration.placements.chain
    links = parameters * search.fitter.link_std.ravel()
    across = np.linalg.svd(chain.gravity[None])[2][1:]
    q, still = np.ascontiguousarray(some.q), np.zeros_like(some.q)
    torques = [
        torque_regressor(chain._replace(gravity=one), q, still, still) @ links
        for one in np.ascontiguousarray(across)
    ]
    return np.stack(torques, axis=2)


def _sums(columns: Array, residual: Array, block: IndexArray) -> tuple[Array, Array]:
    """Return the normal equations of each block, (B, k, k) and (B, k)."""
    count, k = int(block[-1]) + 1, columns.shape[2]
    normal, right = np.zeros((count, k, k)), np.zeros((count, k))
    np.add.at(normal, block, np.einsum('sik,sil->skl', columns, columns))
    np.add.at(right, block, np.einsum('sik,si->sk', columns, residual))
    return normal, right


def _beside(sums: Array) -> Array:
    """Return for each block the sum of the one before and the one behind it."""
    out = np.zeros_like(sums)
    out[1:] += sums[:-1]
    out[:-1] += sums[1:]
    return out


def _gains(
    columns: Array,
    residual: Array,
    block: IndexArray,
    over: Callable[[Array], Array] = lambda sums: sums,
) -> tuple[Array, Array]:
    """Return the gain of parameters of each block, and its excess over other times, (n,)."""
    gains = []
    for share in (0.0, *SHIFTS):
        shifted = np.roll(columns, round(share * len(columns)), axis=0)
        normal, right = (over(each) for each in _sums(shifted, residual, block))
        gains.append(_gain(shifted, residual, block, normal, right))
    return gains[0], gains[0] - np.maximum(np.max(gains[1:], axis=0), 0.0)


def _gain(
    columns: Array, residual: Array, block: IndexArray, normal: Array, right: Array
) -> Array:
    """Return by how much parameters of each block lower logarithms of mean squares, (n,)."""
    k = columns.shape[2]
    size = np.trace(normal, axis1=1, axis2=2)[:, None, None]
    own = np.linalg.solve(normal + RIDGE * (1.0 + size) * np.eye(k), right[..., None])[..., 0]
    left = residual - np.einsum('sik,sk->si', columns, own[block])
    return -np.log(np.mean(left**2, axis=0) / np.mean(residual**2, axis=0))
