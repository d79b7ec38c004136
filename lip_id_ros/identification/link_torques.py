"""Torques of links, and how large their parameters may be."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.placement_search import LENGTH
from lip_id_ros.rigid_body import Chain, STANDARD_GRAVITY
from lip_id_ros.rigid_body.regressor import torque_regressor


def link_prior_std(dataset: Dataset) -> Array:
    """Return deviations of link parameters, (n, 11), that make torques of the measured size."""
    acceleration = STANDARD_GRAVITY + LENGTH * np.sqrt(np.mean(dataset.ddq**2))
    mass = np.sqrt(np.mean(dataset.tau**2)) / (LENGTH * acceleration)
    link = [mass, *[mass * LENGTH] * 3, *[mass * LENGTH**2] * 7]
    return np.tile(link, (dataset.n_joints, 1))


def links_torque(chain: Chain, links: Array, dataset: Dataset) -> Array:
    """Return the torques of the links, shape (N, n) [N m or N]."""
    state = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
    return np.asarray(torque_regressor(chain, *state) @ links.ravel())
