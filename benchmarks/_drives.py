"""Simulated arms whose drives have terms of friction beside the usual ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.conservative_terms import Ripple, Spring
from lip_id_ros.friction.drives import Drive, DriveTerm, LoadTorque
from lip_id_ros.friction.model import FrictionBasis, FrictionModel
from lip_id_ros.friction.terms import (
    Asymmetric,
    Coulomb,
    FrictionTerm,
    LoadCoulomb,
    LoadViscous,
    Offset,
    PositionCoulomb,
    Presliding,
    QuadraticViscous,
    SaturatingViscous,
    Stribeck,
    Viscous,
)
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import link_parameters, scale_of
from lip_id_ros.rigid_body.regressor import torque_regressor

N_JOINTS, JOINT = 3, 1
NOISE, WIDTH = 0.02, 0.05
COUPLED = Drive((2, 1), (1.0, 1.0))

Terms = list[tuple[DriveTerm, list[float]]]

PRESENT: dict[str, tuple[FrictionTerm, list[float]]] = {
    'Stribeck': (Stribeck(WIDTH), [0.0, 0.1, 0.0]),
    'saturating viscous': (SaturatingViscous(WIDTH), [0.0, 0.4, 0.0]),
    'quadratic viscous': (QuadraticViscous(), [0.1]),
    'load-dependent Coulomb': (LoadCoulomb(WIDTH), [0.15]),
    'load-dependent viscous': (LoadViscous(), [0.15]),
    'pre-sliding': (Presliding(WIDTH, 1.0), [0.1]),
    'asymmetric': (Asymmetric(WIDTH), [0.1, 0.1, 0.0, 0.0]),
    'position-dependent Coulomb': (PositionCoulomb(WIDTH), [0.1, 0.0, 0.0, 0.0]),
    'periodic once a turn': (Ripple(1), [0.1, 0.1]),
    'periodic twice a turn': (Ripple(2), [0.1, 0.1]),
    'ripple 9 times a turn': (Ripple(9), [0.1, 0.05]),
    'joint spring': (Spring(), [0.1]),
}
"""Terms of the second joint, with coefficients in standard deviations of the links' torque."""


@dataclass(frozen=True, eq=False)
class RandomArm:
    """
    Rigid links in random places.

    Attributes
    ----------
    chain : Chain
    links : array, shape (n, 11)

    """

    chain: Chain
    links: Array

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the torques of the links, shape (N, n) [N m]."""
        return np.asarray(torque_regressor(self.chain, q, dq, ddq) @ self.links.ravel())

    def gravity(self, q: Array) -> Array:
        """Return the torques of gravity, shape (N, n) [N m]."""
        still = np.zeros_like(q)
        return self.torque(q, still, still)


def random_arm(n_joints: int, seed: int) -> RandomArm:
    """Draw links of about 2 kg and 0.2 m."""
    rng = np.random.default_rng(seed)
    chain = Chain(
        Rotation.random(n_joints, random_state=rng).as_matrix(),
        0.25 * rng.standard_normal((n_joints, 3)),
        np.zeros(n_joints, dtype=bool),
        np.array([0.0, 0.0, -9.81]),
    )
    numbers = 0.4 * rng.standard_normal((n_joints, LINK_PARAMETERS))
    return RandomArm(chain, link_parameters(numbers, scale_of(2.0, 0.2)))


def sines(
    rng: np.random.Generator, t: Array, n_joints: int, count: int, reach: float
) -> tuple[Array, Array, Array]:
    """Return sums of so many sines for each joint, within the reach, with their derivatives."""
    w = 2.0 * np.pi * rng.uniform(0.05, 0.5, (n_joints, count))
    a = rng.standard_normal(w.shape) / (1.0 + 2.0 * w)
    phase = t[:, None, None] * w + rng.uniform(0.0, 2.0 * np.pi, w.shape)
    parts = (a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase))
    q, dq, ddq = (each.sum(axis=2) for each in parts)
    scale = reach / np.abs(q).max(axis=0)
    return scale * q, scale * dq, scale * ddq


def motion(rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Sample a minute of slow sines that reach about half a turn to both sides, at 16 Hz."""
    t = np.arange(960) / 16.0
    q, dq, ddq = np.zeros((3, t.size, N_JOINTS))
    for j in range(N_JOINTS):
        w = 2.0 * np.pi * rng.uniform(0.03, 0.35, 6)
        a = rng.standard_normal(6) / (1.0 + 3.0 * w)
        phase = np.outer(t, w) + rng.uniform(0.0, 2.0 * np.pi, 6)
        size = 3.5 / np.abs(np.sin(phase) @ a).max()
        q[:, j], dq[:, j] = size * np.sin(phase) @ a, size * np.cos(phase) @ (a * w)
        ddq[:, j] = -size * np.sin(phase) @ (a * w**2)
    return t, q, dq, ddq


def recording(seed: int, extra: Terms) -> tuple[RandomArm, Dataset]:
    """Simulate an arm with plain friction of every joint and some terms more."""
    rng = np.random.default_rng(seed)
    arm = random_arm(N_JOINTS, seed)
    t, q, dq, ddq = motion(rng)
    links = arm.torque(q, dq, ddq)
    size = links.std(axis=0)
    plain = [
        (DriveTerm(Drive.of_joint(j), term), [0.1])
        for j in range(N_JOINTS)
        for term in (Viscous(), Coulomb(WIDTH), Offset())
    ]
    scaled = []
    for part, values in [*plain, *extra]:
        loaded = part.term.name.startswith('load') or part.term.name == 'torque'
        scaled.append(np.array(values) * (1.0 if loaded else size[part.drive.joints[0]]))
    basis = FrictionBasis(N_JOINTS, tuple(part for part, _ in [*plain, *extra]))
    clean = links + FrictionModel(basis, np.concatenate(scaled)).torque(q, dq, ddq, links)
    return arm, Dataset(
        t=t,
        q=q,
        dq=dq,
        ddq=ddq,
        tau=clean + NOISE * size * rng.standard_normal(clean.shape),
        joint_names=('a', 'b', 'c'),
        joint_types=('revolute',) * N_JOINTS,
        segment=np.zeros(t.size, dtype=np.int64),
        tau_noiseless=clean,
    )


def present(name: str) -> Terms:
    """Return a term of `PRESENT` as `recording` takes it."""
    term, values = PRESENT[name]
    return [(DriveTerm(Drive.of_joint(JOINT), term), values)]


def coupled() -> Terms:
    """Return friction of a motor that turns with the last two joints."""
    return [(DriveTerm(COUPLED, term), [0.1]) for term in (Viscous(), Coulomb(WIDTH))]


def coupled_efforts() -> Terms:
    """Return what the second effort has of the third joint's torque: motors are coupled."""
    drive = Drive.transmitted(2, to=JOINT)
    return [(DriveTerm(drive, LoadTorque()), [0.7])]


def without_gravity(arm: RandomArm, dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """Take gravity out of the efforts."""
    return replace(dataset, tau=dataset.tau - arm.gravity(dataset.q))


def one_sign_turned(arm: RandomArm, dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """Turn the sign of one joint's effort."""
    sign = np.ones(N_JOINTS)
    sign[rng.integers(N_JOINTS)] = -1.0
    return replace(dataset, tau=dataset.tau * sign)


def all_signs_turned(arm: RandomArm, dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """Turn the signs of all efforts."""
    return replace(dataset, tau=-dataset.tau)


def neighbours_swapped(arm: RandomArm, dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """Give two neighbouring joints in the wrong order."""
    names = list(dataset.joint_names)
    k = rng.integers(N_JOINTS - 1)
    names[k], names[k + 1] = names[k + 1], names[k]
    return dataset.with_joints(names)


def from_tip_to_base(arm: RandomArm, dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """Give the joints from tip to base."""
    return dataset.with_joints(dataset.joint_names[::-1])


def motor_currents(arm: RandomArm, dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """Give the efforts another scale for each joint."""
    scale = np.geomspace(0.03, 0.1, N_JOINTS)
    return replace(dataset, tau=dataset.tau * rng.permutation(scale))


def nothing(arm: RandomArm, dataset: Dataset, rng: np.random.Generator) -> Dataset:
    """Leave the efforts as they are."""
    return dataset


Fault = Callable[[RandomArm, Dataset, np.random.Generator], Dataset]

FAULTS: dict[Fault, tuple[str, ...]] = {
    nothing: (),
    without_gravity: ('effort_without_gravity',),
    one_sign_turned: ('effort_sign',),
    all_signs_turned: ('effort_sign',),
    neighbours_swapped: ('joint_order_by_torque',),
    from_tip_to_base: ('joint_order_by_torque',),
    motor_currents: ('effort_scale',),
}
"""What is wrong with efforts, and the findings that are right."""


def faulty(fault: Fault, seed: int) -> Dataset:
    """Return a recording with one of the faults."""
    arm, dataset = recording(seed, [])
    return fault(arm, dataset, np.random.default_rng(seed))
