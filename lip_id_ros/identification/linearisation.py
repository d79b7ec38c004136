"""
The torques of an arm, linear in its parameters around present ones.

In this order: coefficients of friction (K), shapes of its terms (W), small rotations and
translations of the joints (6 n), parameters of the links (11 n).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.joint_types import JointHistory
from lip_id_ros.model.arm_mean import evaluate_arm_many, pack
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.couplings import couplings_of
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS, placement_derivatives


class Samples(NamedTuple):
    """Samples of a data set, in contiguous arrays (N, n)."""

    q: Array
    dq: Array
    ddq: Array
    tau: Array
    history: JointHistory

    @classmethod
    def of(cls, dataset: Dataset, rows: IndexArray | slice = slice(None)) -> Samples:
        """Return some samples of a data set."""
        arrays = dataset.q, dataset.dq, dataset.ddq, dataset.tau
        q, dq, ddq, tau = (np.ascontiguousarray(each[rows]) for each in arrays)
        past = (None if each is None else each[rows] for each in dataset.history)
        return cls(q, dq, ddq, tau, JointHistory(*past))

    @property
    def state(self) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations."""
        return self.q, self.dq, self.ddq


@dataclass(frozen=True, eq=False)
class Linearisation:
    """What the torques of every recording are regressed on, around present parameters."""

    joint_names: tuple[str, ...]
    chain: Chain
    links: Array  # (n, 11), give the loads that friction depends on
    friction: FrictionModel
    noise: TorqueNoise  # gives the weights of samples

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def n_friction(self) -> int:
        """Number of coefficients of friction, K."""
        return self.friction.basis.size

    @cached_property
    def basis(self) -> FrictionBasis:
        """Terms of friction and their shapes, K + W."""
        return self.friction.basis.with_shapes()

    @property
    def n_placements(self) -> int:
        """Number of directions of the placements, 6 n."""
        return DIRECTIONS * self.n_joints

    @property
    def size(self) -> int:
        """Number of parameters, K + W + 17 n."""
        return self.basis.size + self.n_placements + self.links.size

    @cached_property
    def columns(self) -> tuple[tuple[IndexArray, IndexArray], ...]:
        """For every joint, its coefficients of friction, and its other parameters."""
        first, others = self._first_links(), np.arange(self.basis.size, self.size)
        out = []
        for joint, own in enumerate(self.basis.columns()):
            is_width = own >= self.n_friction
            skipped = self.n_placements + LINK_PARAMETERS * first[joint]
            kept = np.r_[others[: self.n_placements], others[skipped:]]
            out.append((own[~is_width], np.concatenate([own[is_width], kept])))
        return tuple(out)

    def _first_links(self) -> list[int]:
        """Return, for every joint, the first link that its torque depends on."""
        of_links = list(range(self.n_joints))
        for joint, other, _ in couplings_of(self.chain.couplings):
            of_links[other] = min(of_links[other], joint)
        first, loaded, basis = of_links.copy(), self.friction.basis.is_loaded, self.friction.basis
        for part, place in zip(basis.terms, basis.slices, strict=True):
            if loaded[place].any():
                for joint, _ in part.drive.efforts:
                    first[joint] = min(first[joint], *(of_links[k] for k in part.drive.joints))
        return first

    def rows(self, dataset: Dataset) -> tuple[list[Array], Array]:
        """
        Return features (N, k_i + p_i) of every joint and their target (N, n) [N m or N].

        Loads that friction bears change with placements and links.
        """
        parts, target = self.parts(Samples.of(dataset))
        return [self._of_joint(joint, parts) for joint in range(self.n_joints)], target

    def parts(self, samples: Samples) -> tuple[tuple[Array, Array, Array], Array]:
        """Return the features of all joints, by kinds (N, n, p), and the target of `rows`."""
        state, history = samples.state, samples.history
        regressor = torque_regressor(self.chain, *state)
        load = regressor @ self.links.ravel()
        placements = placement_derivatives(self.chain, self.links, *state)
        arm = placements.reshape(*load.shape, -1), regressor
        target = samples.tau
        if self.friction.basis.is_loaded.any():
            slopes = self.friction.load_slopes(*state, load, history)
            arm = arm[0] + slopes @ arm[0], arm[1] + slopes @ arm[1]
            target = target + np.einsum('tij,tj->ti', slopes, load)
        return (self.basis.features(*state, load, history), *arm), target

    def _of_joint(self, joint: int, parts: Sequence[Array]) -> Array:
        """Return the features (N, k_i + p_i) of a joint of those of all, by kinds (N, n, p)."""
        column = np.concatenate(self.columns[joint])
        ends = np.cumsum([0, *(each.shape[2] for each in parts)])
        out, at = np.empty((len(parts[0]), column.size)), 0
        for each, first, last in zip(parts, ends, ends[1:], strict=False):
            own = column[(column >= first) & (column < last)] - first
            is_slice = own.size and own[-1] - own[0] == own.size - 1  # copied far faster
            some = slice(own[0], own[-1] + 1) if is_slice else own
            out[:, at : at + own.size] = each[:, joint, some]
            at += own.size
        return out

    def residual(self, dataset: Dataset) -> Array:
        """Return the residuals of the present parameters, shape (N, n) [N m or N]."""
        arm = ArmPosterior(self.chain, self.links, self.friction, self.noise, np.zeros((0, 0)))
        samples = Samples.of(dataset)
        torques = np.empty((dataset.n_samples, 5 * self.n_joints + 2))
        evaluate_arm_many(torques, *samples.state, *pack(arm, self.friction.compiled))
        residual = dataset.tau - torques[:, : self.n_joints]
        if (memory := self.friction.remembering) is not None:
            load = np.zeros_like(dataset.tau)
            residual -= memory.torque(*samples.state, load, dataset.history)
        return np.asarray(residual)
