"""What is known of an arm before its torques are: nothing but sizes, or a robot description."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.identification.kinematic_calibration import REACH
from lip_id_ros.identification.placement_search import LENGTH
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS, STANDARD_GRAVITY
from lip_id_ros.rigid_body.pseudo_inertia import (
    link_parameter_jacobian,
    link_parameters,
    LinkScale,
    pseudo_inertia,
)
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

LINK_PRIOR = 0.3
"""Precision (inverse standard deviation) of the prior on log-Cholesky numbers."""

TURN_PRIOR = 0.1
"""Precision of the prior on steps of rotations, around no step: some change no torque."""

LEAST_MASS, LEAST_SIZE = 1e-3, 1e-3
"""
Links of a description that are lighter [kg], or whose least radius of gyration is smaller [m],
count as not described: many files have no inertials, or points.
"""


@dataclass(frozen=True, eq=False)
class DescriptionSettings:
    """How far a robot description is trusted, as standard deviations."""

    angle_std: float = float(np.radians(0.5))  # of the direction of each axis [rad]; 0 fixes it
    distance_std: float = 0.002  # of its position [m]; 0 fixes it
    inertial_std: float = 0.5  # of masses, first moments, inertias, as a share

    @property
    def fixes_placements(self) -> bool:
        """Whether the placements are those of the description."""
        return self.angle_std == 0.0 or self.distance_std == 0.0


@dataclass(frozen=True, eq=False)
class ArmPrior:
    """Normal prior on the placements and on the log-Cholesky numbers of the links."""

    chain: Chain | None  # most probable placements; none where only sizes are known
    scale: LinkScale  # most probable links, whose numbers are zero
    precision: Array  # (17 n,), inverse deviations: turns, shifts, numbers

    @property
    def n_joints(self) -> int:
        """Number of joints, n."""
        return self.precision.size // (DIRECTIONS + LINK_PARAMETERS)

    @classmethod
    def vague(cls, n_joints: int, scale: LinkScale) -> ArmPrior:
        """Return the prior that knows about how large links are."""
        placements = np.tile([*[TURN_PRIOR] * 3, *[1.0 / REACH] * 3], n_joints)
        links = np.full(n_joints * LINK_PARAMETERS, LINK_PRIOR)
        return cls(None, scale, np.concatenate([placements, links]))

    @classmethod
    def described(
        cls, description: RobotDescription, settings: DescriptionSettings, usual: LinkScale
    ) -> ArmPrior:
        """
        Return the prior of a robot description, and of usual links where it has none.

        A deviation d of a number changes a pseudo-inertia by the share 2 d. Rotors are not in a
        description.
        """
        n = len(description.joint_names)
        factors, known = _described_factors(description.links, usual)
        turn = 1.0 / settings.angle_std if settings.angle_std > 0.0 else TURN_PRIOR
        shift = 1.0 / settings.distance_std if settings.distance_std > 0.0 else 1.0 / REACH
        links = np.full((n, LINK_PARAMETERS), LINK_PRIOR)
        links[known, :-1] = max(LINK_PRIOR, 2.0 / settings.inertial_std)
        precision = np.concatenate([np.tile([*[turn] * 3, *[shift] * 3], n), links.ravel()])
        rotors = np.broadcast_to(usual.rotors, n)
        return cls(description.chain, LinkScale(factors, rotors), precision)

    def beside(self, inflation: float) -> ArmPrior:
        """
        Return the prior beside samples that count for less than their number by a factor.

        What only knows sizes is to matter no more than beside as many samples that count.
        """
        if self.chain is not None:
            return self
        return replace(self, precision=self.precision / np.sqrt(inflation))

    def deviation(self, chain: Chain, numbers: Array) -> Array:
        """
        Return the distance to the most probable arm, (17 n,) [rad, m, numbers].

        Without such a chain rotations do not deviate, and translations do from zero.
        """
        out = np.zeros((len(numbers), DIRECTIONS))
        if self.chain is None:
            out[:, 3:] = chain.translations
        else:
            turned = np.swapaxes(self.chain.rotations, 1, 2) @ chain.rotations
            out[:, :3] = Rotation.from_matrix(turned).as_rotvec()
            out[:, 3:] = chain.translations - self.chain.translations
        return np.concatenate([out.ravel(), numbers.ravel()])

    def of_links(self) -> tuple[Array, Array]:
        """
        Return the prior of the links' parameters near its centre.

        Returns the centre (n, 11) and precision matrices (n, 11, 11).
        """
        numbers = self.precision[-LINK_PARAMETERS * self.n_joints :].reshape(-1, LINK_PARAMETERS)
        centre = np.zeros_like(numbers)
        slopes = np.linalg.inv(link_parameter_jacobian(centre, self.scale))
        roots = numbers[:, :, None] * slopes
        return link_parameters(centre, self.scale), np.swapaxes(roots, 1, 2) @ roots


def _described_factors(links: Array, usual: LinkScale) -> tuple[Array, BoolArray]:
    """Return Cholesky factors of pseudo-inertias, (n, 4, 4), and which are described, (n,)."""
    pseudo = pseudo_inertia(links[:, :-1])
    mass = np.maximum(links[:, 0], LEAST_MASS)
    centre = links[:, 1:4] / mass[:, None]
    spread = pseudo[:, :3, :3] / mass[:, None, None] - centre[:, :, None] * centre[:, None, :]
    known = (links[:, 0] >= LEAST_MASS) & (np.linalg.eigvalsh(spread)[:, 0] >= LEAST_SIZE**2)
    own = usual.factors[0] @ usual.factors[0].T
    return np.linalg.cholesky(np.where(known[:, None, None], pseudo, own)), known


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
