"""Rigid-body features and a squared exponential for what they leave over."""

from __future__ import annotations

import os

from lip_id_ros.arrays import Array
from lip_id_ros.baselines.regressor import Regressor
from lip_id_ros.baselines.rigid_body import RigidBodyFeatures
from lip_id_ros.baselines.single_output import PerJoint, SingleOutput
from lip_id_ros.baselines.terms import Linear, Motion, SquaredExponential
from lip_id_ros.dataset import Dataset
from lip_id_ros.kernels import JointBasis
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings


class Semiparametric:
    """
    The paper's estimator SP (eq. K-SP): one Gaussian process per joint.

    Parameters
    ----------
    urdf : path
        Where the kinematics come from.

    """

    def __init__(self, urdf: str | os.PathLike[str]) -> None:
        self._urdf = urdf

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> PerJoint:
        """Fit the joints one after another."""
        features = RigidBodyFeatures(Regressor(self._urdf, dataset))

        def rigid_body(basis: JointBasis, joint: int) -> RigidBodyTerm:
            return RigidBodyTerm(features, joint)

        return SingleOutput((rigid_body, SquaredExponential)).fit(dataset, settings, progress)


class RigidBodyTerm(Linear):
    """
    A covariance that is linear in one joint's row of the regressor.

    Parameters
    ----------
    features : RigidBodyFeatures
    joint : int

    """

    def __init__(self, features: RigidBodyFeatures, joint: int) -> None:
        self._features = features
        self._joint = joint

    def features(self, motion: Motion) -> Array:
        """Return the joint's rows, shape (N, 14 n)."""
        return self._features.torque(*motion)[:, self._joint]
