"""The arm to export: links, joints, friction and ranges, taken from a model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError
from lip_id_ros.friction.drives import DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.denavit_hartenberg import with_standard_frames
from lip_id_ros.rigid_body.regressor import potential_regressor, torque_regressor

RECORDED = (
    'Position ranges, velocities and efforts are those of the recordings, not the limits of the '
    'arm.'
)
BASE_PARAMETERS = (
    'Torques determine masses, centres of mass and inertias only up to sums over links: these '
    'are the links of one arm among many with the same torques. They determine neither the place '
    'and the height of the base nor its turn about the vertical, and an arm and its mirror image '
    'have the same torques: here the first axis points up. Compare a picture of it with the robot.'
)
NO_GRAVITY = (
    'The recorded efforts leave gravity out: masses and centres of mass have no weight here. '
    'Switch gravity off where this arm is simulated.'
)
RECORDED_LOAD = (
    'A gripper or load that the arm carried while it was recorded is part of its last link.'
)


@dataclass(frozen=True, eq=False)
class JointRanges:
    """Range of recorded positions [rad or m], and largest absolute values of the rest."""

    q_min: Array
    q_max: Array
    dq_max: Array
    ddq_max: Array
    tau_max: Array


@dataclass(frozen=True, eq=False)
class ArmDescription:
    """
    An identified arm: links, joints, friction.

    `links`, shape (n, 11): in `Chain`'s frames. `potential_reference`, shape (n,): positions at
    which the potential energy is zero. `remarks`: sentences on what the data do not determine and
    what is left out. `summary`: of the fit, with the standard deviations of the placements.
    """

    name: str
    joint_names: tuple[str, ...]
    chain: Chain
    links: Array
    friction: FrictionModel
    ranges: JointRanges
    potential_reference: Array
    remarks: tuple[str, ...] = ()
    summary: Mapping[str, Any] = field(default_factory=dict)

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the torques of links and friction, shape (N, n) [N m or N]."""
        load = torque_regressor(self.chain, q, dq, ddq) @ self.links.ravel()
        return np.asarray(load + self.friction.torque(q, dq, ddq, load))

    def friction_terms(self) -> Iterator[tuple[DriveTerm, Array]]:
        """Yield the terms of friction with their coefficients."""
        basis = self.friction.basis
        for part, place in zip(basis.terms, basis.slices, strict=True):
            yield part, self.friction.coefficients[place]

    def reference_potential(self) -> float:
        """Return the potential energy of the links at the reference, relative to the base [J]."""
        at = self.potential_reference[None]
        return float((potential_regressor(self.chain, at) @ self.links.ravel())[0])

    def in_standard_frames(self) -> ArmDescription:
        """Return the same arm in frames by the convention of Denavit and Hartenberg."""
        chain, links = with_standard_frames(self.chain, self.links)
        return replace(self, chain=_contiguous(chain), links=np.ascontiguousarray(links))


def _contiguous(chain: Chain) -> Chain:
    rotations, translations = (np.ascontiguousarray(x) for x in chain[:2])
    return chain._replace(rotations=rotations, translations=translations)


@dataclass(frozen=True)
class Exported:
    """
    An arm to export, in frames of Denavit and Hartenberg, and in those of the model.

    The latter are those of the URDF that it was fitted with, if any. `residual_gp`, or None: what
    the model has beside links and friction, which is not exported.
    """

    arm: ArmDescription
    in_model_frames: ArmDescription
    residual_gp: str | None


def describe(model: InverseDynamicsModel, name: str) -> Exported:
    """Take links, joints and friction from a model; ModelError if it has no links."""
    if model.arm is None:
        raise ModelError(
            f'rigid links were expected, but the model has the kernel {model.kernel!r} alone, '
            'which no other program evaluates; fit with the default kernel.'
        )
    residual_gp = residual_gp_of(model)
    remarks = [BASE_PARAMETERS, RECORDED, _load(model), *_efforts(model)]
    remarks += [] if model.has_potential else [NO_GRAVITY]
    remarks += [] if residual_gp is None else [f'Left out: {residual_gp}.']
    still = np.zeros(model.n_joints)
    arm = ArmDescription(
        name=name,
        joint_names=model.joint_names,
        chain=model.arm.chain,
        links=model.arm.links,
        friction=model.arm.friction,
        ranges=_ranges(model),
        potential_reference=model.potential_reference if model.has_potential else still,
        remarks=tuple(remarks),
        summary=model.summary,
    )
    return Exported(arm.in_standard_frames(), arm, residual_gp)


def _load(model: InverseDynamicsModel) -> str:
    mass = model.provenance.get('payload_mass')
    if not isinstance(mass, float):
        return RECORDED_LOAD
    return f'{RECORDED_LOAD} So is a payload of {mass:.4g} kg, identified afterwards.'


def _efforts(model: InverseDynamicsModel) -> list[str]:
    scaled = any((each.scale != 1.0).any() for each in model.effort_calibrations)
    if not scaled:
        return []
    return [
        'Torques are N m or N: recorded efforts times effort_scale. A driver that takes efforts '
        'in the recorded unit needs them divided by it.'
    ]


def residual_gp_of(model: InverseDynamicsModel) -> str | None:
    """Return the joints with Gaussian processes in words, None where there is none."""
    residual_gp = model.residual_gp
    if residual_gp is None:
        return None
    names = np.array(model.joint_names)
    beside = names[residual_gp.joints & ~residual_gp.replaces].tolist()
    instead = names[residual_gp.replaces].tolist()
    parts = [f'beside links and friction at {", ".join(beside)}'] if beside else []
    parts += [f'in place of links and friction at {", ".join(instead)}'] if instead else []
    return f'Gaussian processes {" and ".join(parts)}'


def _ranges(model: InverseDynamicsModel) -> JointRanges:
    low, high = model.training_range
    largest = np.maximum(np.abs(low), np.abs(high))
    return JointRanges(
        q_min=low[0],
        q_max=high[0],
        dq_max=largest[1],
        ddq_max=largest[2],
        tau_max=model.largest_torque,
    )
