"""What there is to export: an identified arm, without the model that it comes from."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError
from lip_id_ros.friction.model import DriveTerm, FrictionBasis
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.consistent_links import consistent_links
from lip_id_ros.rigid_body.denavit_hartenberg import with_standard_frames
from lip_id_ros.rigid_body.regressor import potential_regressor, torque_regressor

EXACT = 1e-10
"""Relative change of torques that is rounding."""
LARGEST_CHANGE = 0.05
"""Relative change of torques above which links are not those of the fit any more."""


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
    friction : FrictionBasis
    coefficients : array
        Of the friction.
    ranges : JointRanges
    potential_reference : array, shape (n,)
        Positions at which the potential energy is zero [rad or m].
    remarks : tuple of str
        Sentences on what the data could not tell and what is left out.

    """

    name: str
    joint_names: tuple[str, ...]
    chain: Chain
    links: Array
    friction: FrictionBasis
    coefficients: Array
    ranges: JointRanges
    potential_reference: Array
    remarks: tuple[str, ...] = ()

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    @property
    def has_gravity(self) -> bool:
        """Whether the torques have gravity in them."""
        return bool(self.chain.gravity.any())

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the torques of links and friction, shape (N, n) [N m or N]."""
        load = torque_regressor(self.chain, q, dq, ddq) @ self.links.ravel()
        return load + self.friction_torque(q, dq, load, self.friction.terms)

    def friction_torque(
        self, q: Array, dq: Array, load: Array, terms: tuple[DriveTerm, ...]
    ) -> Array:
        """
        Return the torques of some of the terms of the friction, shape (N, n) [N m or N].

        Parameters
        ----------
        q, dq : arrays, shape (N, n)
        load : array, shape (N, n)
            Torques of the links.
        terms : tuple of DriveTerm
            Any of `friction.terms`.

        """
        out = np.zeros_like(dq)
        for part, place in zip(self.friction.terms, self.friction.slices, strict=True):
            if part in terms:
                features = part.term.features(part.drive.state(q, dq, load))
                torque = features @ self.coefficients[place]
                for joint, ratio in zip(part.drive.joints, part.drive.ratios, strict=True):
                    out[:, joint] += ratio * torque
        return out

    def reference_potential(self) -> float:
        """Return the potential energy of the links at the reference, relative to the base [J]."""
        at = self.potential_reference[None]
        return float((potential_regressor(self.chain, at) @ self.links.ravel())[0])

    def in_standard_frames(self) -> ArmDescription:
        """Return the same arm in frames by the convention of Denavit and Hartenberg."""
        chain, links = with_standard_frames(self.chain, self.links)
        return replace(self, chain=_contiguous(chain), links=np.ascontiguousarray(links))

    def with_consistent_links(self) -> ArmDescription:
        """
        Return the arm with links that can exist; a remark says where that changes torques.

        Raises
        ------
        ModelError
            If it changes the torque of a joint by more than 5 %.

        """
        found = consistent_links(self.chain, self.links)
        worst = int(np.argmax(found.torque_change))
        change = (
            f'{100.0 * found.torque_change[worst]:.2g} % at {self.joint_names[worst]} (root mean '
            'square over random states)'
        )
        if found.torque_change[worst] > LARGEST_CHANGE:
            raise ModelError(
                'links that can exist were expected, but those of the model cannot, and the '
                f'nearest ones change torques by up to {change}; export --c, which needs no such '
                'links, or fit with more motion of that joint.'
            )
        remarks = self.remarks
        if found.torque_change[worst] > EXACT:
            remark = (
                'No links that can exist have the torques of the fit: the nearest ones change '
                f'torques by up to {change}.'
            )
            remarks = (*remarks, remark)
        return replace(self, links=found.parameters, remarks=remarks)


def _contiguous(chain: Chain) -> Chain:
    rotations, translations = (np.ascontiguousarray(x) for x in chain[:2])
    return chain._replace(rotations=rotations, translations=translations)
