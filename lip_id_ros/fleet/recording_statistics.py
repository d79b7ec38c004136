"""
Square-root statistics of one recording, from which its own friction is eliminated.

With given placements the rows of joint i are [friction, links, torque]. Their triangular factor
has the friction of the recording in its first rows alone, so that the rest adds up over
recordings: block angular least squares (Björck, Numerical Methods for Least Squares Problems,
1996, 6.3; Golub and Van Loan, Matrix Computations, 4th ed., 5.3; maths.md, section 14).

"""

from __future__ import annotations

from dataclasses import dataclass
import os

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.fleet.results import RecordingStatistics
from lip_id_ros.friction.compiled import CompiledFriction, friction_features
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.identification.sample_selection import (
    explained,
    moving,
    plausible,
)
from lip_id_ros.identification.statistics import TorqueStatistics
from lip_id_ros.loading import load_dataset
from lip_id_ros.model.arm_mean import evaluate_arm_many, pack
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.preprocessing import for_training
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.settings import Config

CHUNK = 2000
"""Samples whose regressor is in memory at one time."""


@dataclass(frozen=True, eq=False)
class Regression:
    """
    What the torques of every recording are regressed on.

    Attributes
    ----------
    joint_names : tuple of str
    chain : Chain
        Placements of the joints, the same for all recordings.
    links : array, shape (n, 11)
        Present parameters, which give the loads that friction depends on.
    friction : FrictionModel
        Terms with present coefficients, which residuals of bad samples are measured with.
    noise : TorqueNoise
        Gives the weights of samples.

    """

    joint_names: tuple[str, ...]
    chain: Chain
    links: Array
    friction: FrictionModel
    noise: TorqueNoise

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def n_friction(self) -> int:
        """Number of coefficients of friction, K."""
        return self.friction.basis.size

    def columns(self) -> tuple[tuple[IndexArray, IndexArray], ...]:
        """Return, for every joint, its coefficients of friction and its link parameters."""
        every = np.arange(self.links.size)
        return tuple(
            (own, every[LINK_PARAMETERS * joint :])
            for joint, own in enumerate(self.friction.basis.columns())
        )

    def rows(self, dataset: Dataset) -> list[Array]:
        """Return the features of every joint, shapes (N, k_i + p_i)."""
        regressor = torque_regressor(self.chain, *_state(dataset))
        load = regressor @ self.links.ravel()
        sign = dataset.low_passed_sign
        features = friction_features(self.friction.basis, *_state(dataset), load, sign)
        return [
            np.hstack([features[:, joint, own], regressor[:, joint, links]])
            for joint, (own, links) in enumerate(self.columns())
        ]

    def residual(self, dataset: Dataset) -> Array:
        """Return the residuals of the present parameters, shape (N, n) [N m or N]."""
        arm = ArmPosterior(self.chain, self.links, self.friction, self.noise, np.zeros((0, 0)))
        torques = np.empty((dataset.n_samples, 5 * self.n_joints + 2))
        packed_arm = pack(arm, CompiledFriction.of(self.friction))
        evaluate_arm_many(torques, *_state(dataset), *packed_arm)
        return np.asarray(dataset.tau - torques[:, : self.n_joints])


def statistics_of_source(
    path: str | os.PathLike[str], regression: Regression, config: Config
) -> RecordingStatistics:
    """
    Read a recording and gather its statistics; raises what `load_dataset` raises.

    Parameters
    ----------
    path : path
    regression : Regression
    config : Config

    """
    data = load_dataset(path, config).with_joints(regression.joint_names)
    data = for_training(data, config.preprocessing, config.fit.kernel)
    return statistics_of(data, regression)


def statistics_of(dataset: Dataset, regression: Regression) -> RecordingStatistics:
    """Gather the statistics of a recording without its bad samples."""
    dataset = moving(dataset)
    kept = plausible(dataset) & explained(regression.residual(dataset))
    statistics = empty_statistics(regression)
    good = np.flatnonzero(kept)
    for chunk in _chunks(good.size):
        statistics = updated(statistics, dataset.select(good[chunk]), regression)
    return packed(statistics, regression)


def empty_statistics(regression: Regression) -> TorqueStatistics:
    """Return the statistics of no samples: friction first, then links."""
    shift = regression.n_friction
    return TorqueStatistics.empty(
        [np.concatenate([own, shift + links]) for own, links in regression.columns()]
    )


def updated(
    statistics: TorqueStatistics, dataset: Dataset, regression: Regression
) -> TorqueStatistics:
    """Return statistics with further samples, whose features are in memory together."""
    features = regression.rows(dataset)
    return statistics.update(features, dataset.tau, regression.noise.weights(dataset.dq))


def packed(statistics: TorqueStatistics, regression: Regression) -> RecordingStatistics:
    """Return statistics as flat arrays, friction of the recording apart from what adds up."""
    tops, rests = [], []
    for factor, (own, links) in zip(statistics.factors, regression.columns(), strict=True):
        tops.append(factor[: own.size].ravel())
        rests.append(factor[own.size :, own.size :][np.triu_indices(links.size + 1)])
    return RecordingStatistics(
        friction_rows=np.concatenate(tops),
        link_factors=np.concatenate(rests),
        counts=statistics.counts,
    )


def friction_blocks(rows: Array, regression: Regression) -> list[Array]:
    """Return every joint's rows of friction, (..., k_i, k_i + p_i + 1), of (..., all of them)."""
    shapes = [(own.size, own.size + links.size + 1) for own, links in regression.columns()]
    ends = np.cumsum([height * width for height, width in shapes])[:-1]
    parts = zip(np.split(rows, ends, axis=-1), shapes, strict=True)
    return [part.reshape(*rows.shape[:-1], *shape) for part, shape in parts]


def link_triangles(factors: Array, regression: Regression) -> list[Array]:
    """Return every joint's triangle of links, (..., p_i + 1, p_i + 1), of (..., all of them)."""
    triangles, at = [], 0
    for _, links in regression.columns():
        upper = np.triu_indices(links.size + 1)
        triangle = np.zeros((*factors.shape[:-1], links.size + 1, links.size + 1))
        triangle[..., *upper] = factors[..., at : at + upper[0].size]
        at += upper[0].size
        triangles.append(triangle)
    return triangles


def _state(dataset: Dataset) -> tuple[Array, Array, Array]:
    q, dq, ddq = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
    return q, dq, ddq


def _chunks(count: int) -> list[IndexArray]:
    return np.array_split(np.arange(count), -(-count // CHUNK)) if count else []
