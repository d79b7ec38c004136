"""What there is to export: an identified arm, without the model that it comes from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.drives import DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.denavit_hartenberg import with_standard_frames
from lip_id_ros.rigid_body.regressor import potential_regressor, torque_regressor


@dataclass(frozen=True, eq=False)
class JointRanges:
    """
    What the joints did in the recordings.

    Attributes
    ----------
    q_min, q_max : arrays, shape (n,)
        [rad or m].
    dq_max, ddq_max : arrays, shape (n,)
        Largest absolute velocity and acceleration [per s, per s^2].
    tau_max : array, shape (n,)
        Largest absolute torque [N m or N].

    """

    q_min: Array
    q_max: Array
    dq_max: Array
    ddq_max: Array
    tau_max: Array

    def random_states(self, count: int, rng: np.random.Generator) -> Array:
        """Draw q, dq, ddq evenly from the ranges, shape (3, count, n)."""
        shape = (count, len(self.q_min))
        q = rng.uniform(self.q_min, self.q_max, shape)
        rates = [limit * rng.uniform(-1.0, 1.0, shape) for limit in (self.dq_max, self.ddq_max)]
        return np.stack([q, *rates])


@dataclass(frozen=True, eq=False)
class ArmDescription:
    """
    An identified arm: links, joints, friction.

    Attributes
    ----------
    name : str
    joint_names : tuple of str
        From base to tip.
    chain : Chain
    links : array, shape (n, 11)
        Parameters of the links, as in `Chain`'s frames.
    friction : FrictionModel
    ranges : JointRanges
    potential_reference : array, shape (n,)
        Positions at which the potential energy is zero [rad or m].
    remarks : tuple of str
        Sentences on what the data do not determine and what is left out.
    summary : mapping
        Of the fit, with the standard deviations of the placements.

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
        return np.asarray(load + self.friction.torque(q, dq, load))

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
