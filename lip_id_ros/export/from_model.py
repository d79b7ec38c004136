"""The one place where a model is taken apart for export."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.errors import ModelError
from lip_id_ros.export.arm import ArmDescription, JointRanges
from lip_id_ros.friction.model import FrictionBasis, plain_friction
from lip_id_ros.kernels import Friction
from lip_id_ros.model import InverseDynamicsModel

RECORDED = (
    'Position ranges, velocities and efforts are those of the recordings, not the limits of the '
    'arm.'
)
BASE_PARAMETERS = (
    'Torques determine masses, centres of mass and inertias only up to sums over links: these '
    'are the links of one arm among many with the same torques. They determine neither the place '
    'and the height of the base nor its turn about the vertical, and an arm and its mirror image '
    'have the same torques: the first axis points up here. Look whether the arm turns as yours.'
)
NO_GRAVITY = (
    'The recorded efforts leave gravity out: masses and centres of mass have no weight here. '
    'Switch gravity off where this arm is simulated.'
)


@dataclass(frozen=True)
class Exported:
    """
    An arm to export.

    Attributes
    ----------
    arm : ArmDescription
        In frames by the convention of Denavit and Hartenberg.
    remainder : str or None
        What the model has beside links and friction, which is not exported.

    """

    arm: ArmDescription
    remainder: str | None


def describe(model: InverseDynamicsModel, name: str) -> Exported:
    """
    Take links, joints and friction from a model.

    Parameters
    ----------
    model : InverseDynamicsModel
    name : str
        Of the arm.

    Raises
    ------
    ModelError
        If the model has no rigid links.

    """
    kernel = model.process.prior.kernel
    if not kernel.links:
        raise ModelError(
            f'rigid links were expected, but the model has the kernel {model.kernel!r} alone, '
            'which no other program evaluates; fit with the default kernel.'
        )
    remainder = _remainder(model)
    left_out = () if remainder is None else (f'Left out: {remainder}.',)
    links, features = kernel.links[0], model.process.states.links[0]
    friction, coefficients = _friction(model)
    arm = ArmDescription(
        name=name,
        joint_names=model.joint_names,
        chain=links.chain,
        links=links.parameters(features, model.process.alpha),
        friction=friction,
        coefficients=coefficients,
        ranges=_ranges(model),
        potential_reference=(
            model.potential_reference if model.has_potential else np.zeros(model.n_joints)
        ),
        remarks=(BASE_PARAMETERS, RECORDED, *(() if model.has_potential else (NO_GRAVITY,)))
        + left_out,
    )
    return Exported(arm.in_standard_frames(), remainder)


def _remainder(model: InverseDynamicsModel) -> str | None:
    kernel = model.process.prior.kernel
    parts = (
        [] if kernel.energy.is_empty else [f'the energies of the kernel {kernel.energy.name!r}']
    )
    parts += [term.name for term in kernel.per_joint if not isinstance(term, Friction)]
    return ' and '.join(parts) or None


def _friction(model: InverseDynamicsModel) -> tuple[FrictionBasis, np.ndarray]:
    terms = zip(
        model.process.prior.kernel.per_joint,
        model.process.prior.hyperparameters.per_joint,
        model.process.states.per_joint,
        strict=True,
    )
    for kernel, parameters, inputs in terms:
        if isinstance(kernel, Friction):
            coefficients = kernel.coefficients(parameters, inputs, model.process.alpha)
            return plain_friction(model.n_joints, kernel.sign_width.tolist()), coefficients.ravel()
    return FrictionBasis(model.n_joints, ()), np.zeros(0)


def _ranges(model: InverseDynamicsModel) -> JointRanges:
    states = model.process.states
    return JointRanges(
        q_min=states.q.min(axis=0),
        q_max=states.q.max(axis=0),
        dq_max=np.abs(states.dq).max(axis=0),
        ddq_max=np.abs(states.ddq).max(axis=0),
        tau_max=np.abs(model.process.tau).max(axis=0),
    )
