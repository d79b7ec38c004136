"""What every model of inverse dynamics answers: ours, and those that it is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

from lip_id_ros.arrays import Array, EVERY, Rows


@dataclass(frozen=True)
class StandardDeviation:
    """
    Posterior standard deviations of torques and of the energies.

    Attributes
    ----------
    tau : array, shape (N, n)
        Of noiseless torques [N m or N].
    measurement : array, shape (N, n)
        Of measured torques: those of noiseless torques and of the noise together [N m or N].
    kinetic : array, shape (N,)
        [J].
    potential : array, shape (N,), or None
        Of the potential energy relative to the reference positions [J]; None where the model has
        no potential energy.

    """

    tau: Array
    measurement: Array
    kinetic: Array
    potential: Array | None


@dataclass(frozen=True)
class TorquePrediction:
    """Torques at N joint states, and energies where the model has them, or None."""

    tau: Array  # (N, n) [N m or N]
    kinetic: Array | None  # (N,) [J]
    potential: Array | None  # (N,), up to a constant [J]


@dataclass(frozen=True)
class Prediction(TorquePrediction):
    """
    Posterior mean at N joint states; tau = inertial + coriolis + gravity + friction.

    Attributes
    ----------
    inertial, coriolis, gravity, friction : arrays, shape (N, n)
        [N m or N]. Friction holds everything that is not Lagrangian, the residual included.
    kinetic : array, shape (N,)
        [J].
    potential : array, shape (N,), or None
        Relative to the reference positions [J]; None where the model has none.
    std : StandardDeviation or None
        Only where it was asked for.

    """

    kinetic: Array
    potential: Array | None
    inertial: Array
    coriolis: Array
    gravity: Array
    friction: Array
    std: StandardDeviation | None = None


class Parts(NamedTuple):
    """Parts of the torques (N, n) at N joint states [N m or N], and energies (N,) [J]."""

    tau: Array  # the sum of the others
    inertial: Array
    coriolis: Array
    gravity: Array
    friction: Array
    kinetic: Array
    potential: Array  # up to a constant


class Query(NamedTuple):
    """Posterior mean at one joint state: a tuple, since a control loop waits for it."""

    tau: Array  # (n,) [N m or N]
    kinetic: float  # [J]
    potential: float  # from the reference [J]; nan where none
    gravity: Array  # (n,), a part of tau [N m or N]


class TorqueModel(Protocol):
    """Predicts the torques of an arm; q, dq and ddq have shape (N, n)."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints from base to tip."""

    @property
    def joint_types(self) -> tuple[str, ...]:
        """'revolute' or 'prismatic', per joint."""

    @property
    def n_joints(self) -> int:
        """Number of joints n."""

    @property
    def has_potential(self) -> bool:
        """Whether the model predicts potential energy."""

    @property
    def size(self) -> int:
        """Number of numbers that the model keeps in order to predict."""

    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        """Torques [N m or N], and energies [J] where the model has them, at N joint states."""


@runtime_checkable
class DynamicsModel(TorqueModel, Protocol):
    """A torque model that also predicts the parts of the torque, M(q) and its own uncertainty."""

    @property
    def noise_std(self) -> Array:
        """Standard deviation of a measured torque's noise in motion, shape (n,) [N m or N]."""

    @property
    def training_range(self) -> tuple[Array, Array]:
        """Lowest and highest q, dq and ddq of the training data, each of shape (3, n)."""

    def predict(
        self,
        q: Array,
        dq: Array,
        ddq: Array,
        t: Array | None = None,
        *,
        return_std: bool = False,
    ) -> Prediction:
        """Torques with their parts, energies, and standard deviations where asked for."""

    def standard_deviation(
        self,
        q: Array,
        dq: Array,
        ddq: Array,
        t: Array | None = None,
        *,
        rows: Rows = EVERY,
    ) -> StandardDeviation:
        """Return standard deviations at some rows of N joint states; others are their past."""

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        """Torques and energies at one joint state, arrays of shape (n,), without checks."""

    def efforts(self, torque: Array) -> Array:
        """Efforts for torques of joints of shape (..., n): of coupled motors, where they are."""

    def inertia_matrix(self, q: Array) -> Array:
        """Inertia matrices, shape (N, n, n) [kg m^2, kg m or kg]."""
