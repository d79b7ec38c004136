"""
Where the joints of an arm are, found from torques alone (docs/maths.md, section 10).

Torques are linear in the parameters of links and friction once the placements of the joints are
known, so that least squares over placements (by variable projection: the linear parameters are
solved for at every step) is all that is left. It has several minima, hence several starts.

"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.kernels import RigidLinks
from lip_id_ros.kernels.features import PRISMATIC
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS, placement_derivatives

REACH = 3.0
"""Standard deviation of the prior on distances between joints [m], where residuals have one."""

TOLERANCE = 1e-4
"""A descent ends where a step gains less than this share of its cost."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """
    Least squares at one vector of placements.

    Attributes
    ----------
    chain : Chain
    features : array, shape (N n, k)
        In units of the residuals' deviations.
    factor : CholeskyFactor
        Of their normal equations.
    parameters : array, shape (k,)
        Of links, then of friction, in units of their prior deviations.
    left_over : array, shape (N, n)
        Residuals in units of their deviations.

    """

    chain: Chain
    features: Array
    factor: CholeskyFactor
    parameters: Array
    left_over: Array


class PlacementProblem:
    """
    Torques of links with unknown placements: residuals and Jacobian for `least_squares`.

    A vector holds, joint by joint, the rotation vector and the translation of the placement.

    Parameters
    ----------
    dataset : Dataset
    friction : array, shape (N, n, k)
        Features of what is added to the links, in units of prior deviations.
    deviations : array, shape (n, 11)
        Prior standard deviations of the links' parameters.
    scale : array, shape (n,)
        Standard deviations of the residuals [N m or N].
    gravity : array, shape (3,)
        [m/s^2].

    """

    def __init__(
        self, dataset: Dataset, friction: Array, deviations: Array, scale: Array, gravity: Array
    ) -> None:
        self._state = tuple(np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
        self._tau = dataset.tau / scale
        self._friction = (friction / scale[:, None]).reshape(dataset.tau.size, -1)
        self._prismatic = np.array([kind == PRISMATIC for kind in dataset.joint_types])
        self._deviations, self._scale, self._gravity = deviations, scale, gravity
        self.n_joints = dataset.n_joints
        self._fitted = lru_cache(maxsize=8)(self._fit)

    def fit(self, vector: Array) -> Fitted:
        """
        Solve for the linear parameters at given placements, shape (6 n,).

        Raises
        ------
        FitError
            If the data are not finite in these units.

        """
        return self._fitted(vector.tobytes())

    def residuals(self, vector: Array) -> Array:
        """Return what is left over, with the priors on parameters and distances."""
        at = self.fit(vector)
        distances = vector.reshape(-1, DIRECTIONS)[:, 3:].ravel() / REACH
        return np.concatenate([at.left_over.ravel(), -at.parameters, distances])

    def jacobian(self, vector: Array) -> Array:
        """Differentiate the residuals, with Kaufman's approximation of variable projection."""
        at = self.fit(vector)
        n = self.n_joints
        parameters = (
            at.parameters[: LINK_PARAMETERS * n].reshape(n, LINK_PARAMETERS) * self._deviations
        )
        slopes = placement_derivatives(at.chain, parameters, *self._state)
        slopes /= self._scale[:, None, None]
        rotations = vector.reshape(n, DIRECTIONS)[:, :3]
        turning = np.stack([right_jacobian(rotation) for rotation in rotations])
        slopes[..., :3] = np.einsum('tijk,jkl->tijl', slopes[..., :3], turning)
        along = slopes.reshape(len(at.features), -1)
        taken = at.factor.solve(at.features.T @ along)
        distances = np.kron(np.eye(n), np.eye(3, DIRECTIONS, 3)) / REACH
        return np.vstack([at.features @ taken - along, taken, distances])

    def links(self, vector: Array) -> RigidLinks:
        """Return the links with joints in these places."""
        return RigidLinks(self.fit(vector).chain, self._deviations)

    def _fit(self, vector: bytes) -> Fitted:
        placements = np.frombuffer(vector).reshape(-1, DIRECTIONS)
        chain = Chain(
            Rotation.from_rotvec(placements[:, :3]).as_matrix(),
            np.ascontiguousarray(placements[:, 3:]),
            self._prismatic,
            self._gravity,
        )
        links = RigidLinks(chain, self._deviations).torque(*self._state)
        features = np.hstack(
            [(links / self._scale[:, None]).reshape(self._tau.size, -1), self._friction]
        )
        normal = features.T @ features
        normal.reshape(-1)[:: len(normal) + 1] += 1.0
        factor = CholeskyFactor.of(normal)
        parameters = factor.solve(features.T @ self._tau.ravel())
        left_over = self._tau - (features @ parameters).reshape(self._tau.shape)
        return Fitted(chain, features, factor, parameters, left_over)


def right_jacobian(rotation: Array) -> Array:
    """
    Return what takes changes of a rotation vector to small rotations about the turned axes.

    exp(v + dv) = exp(v) exp(J dv) to first order.

    """
    angle = float(np.linalg.norm(rotation))
    x, y, z = rotation
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-4:
        return np.asarray(np.eye(3) - 0.5 * skew + skew @ skew / 6.0)
    first = (1.0 - np.cos(angle)) / angle**2
    second = (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) - first * skew + second * skew @ skew)


def descend(problem: PlacementProblem, start: Array, evaluations: int) -> tuple[float, Array]:
    """Go downhill by Levenberg and Marquardt; return half the sum of squares, and where."""
    found = least_squares(
        problem.residuals,
        start,
        problem.jacobian,
        method='lm',
        ftol=TOLERANCE,
        max_nfev=evaluations,
    )
    return float(found.cost), np.asarray(found.x)
