"""Identification with known kinematics and with friction terms selected joint by joint."""

from __future__ import annotations

from benchmarks.baselines.interface import Baseline, Methods
from benchmarks.baselines.rigid_body import (
    contiguous,
    Identification,
    known_chain,
)
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.identification.friction_selection import select_friction
from lip_id_ros.identification.link_torques import link_prior_std
from lip_id_ros.model import TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)
from lip_id_ros.settings import FitSettings

STAGE = 'selection of friction'


class RigidBodyFriction(Baseline):
    """Torques and energies of identified links, shape (n, 11), and friction."""

    has_potential = True

    def __init__(
        self,
        joint_names: tuple[str, ...],
        joint_types: tuple[str, ...],
        chain: Chain,
        links: Array,
        friction: FrictionModel,
    ) -> None:
        super().__init__(joint_names, joint_types)
        self._chain, self._links, self.friction = chain, links, friction

    @property
    def size(self) -> int:
        """Number of numbers that the model keeps."""
        return self._links.size + self.friction.coefficients.size

    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        """Return torques and both energies."""
        q, dq, ddq = contiguous(q, dq, ddq)
        chain, links = self._chain, self._links.ravel()
        load = torque_regressor(chain, q, dq, ddq) @ links
        return TorquePrediction(
            load + self.friction.torque(q, dq, ddq, load),
            kinetic_regressor(chain, q, dq) @ links,
            potential_regressor(chain, q) @ links,
        )


class FrictionIdentification(Identification):
    """
    Least squares on rigid links and the friction terms that the default fit has on offer.

    The rival that has everything of the default fit and the true kinematics: what is selected, and
    how, is the same (`lip_id_ros.identification.friction_selection`).

    """

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Baseline:
        """Select friction and identify from all samples."""
        chain = known_chain(self._urdf, dataset)
        selected = select_friction(dataset, chain, link_prior_std(dataset))
        progress(STAGE, 1, 1)
        names = dataset.joint_names, dataset.joint_types
        return RigidBodyFriction(*names, chain, selected.link_parameters, selected.friction)


METHODS: Methods = {'rigid_body_friction': FrictionIdentification}
