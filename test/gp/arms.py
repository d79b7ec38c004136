"""Arms whose inertia matrix, torques and energies stand in textbooks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset

G = 9.81


class Arm(ABC):
    """Closed-form dynamics; every method takes rows of samples."""

    joint_types: tuple[str, ...]

    @abstractmethod
    def inertia(self, q: Array) -> Array:
        """Return M(q), shape (N, n, n)."""

    @abstractmethod
    def coriolis(self, q: Array, dq: Array) -> Array:
        """Return the Coriolis and centrifugal torques, shape (N, n)."""

    @abstractmethod
    def gravity(self, q: Array) -> Array:
        """Return the gravity torques, shape (N, n)."""

    @abstractmethod
    def potential(self, q: Array) -> Array:
        """Return V(q), shape (N,)."""

    def kinetic(self, q: Array, dq: Array) -> Array:
        return 0.5 * np.asarray(np.einsum('ti,tij,tj->t', dq, self.inertia(q), dq))

    def inertial(self, q: Array, ddq: Array) -> Array:
        return np.asarray(np.einsum('tij,tj->ti', self.inertia(q), ddq))

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        return self.inertial(q, ddq) + self.coriolis(q, dq) + self.gravity(q)


@dataclass(frozen=True)
class PolarArm(Arm):
    """A beam that turns in the vertical plane, with a mass that slides on it."""

    beam: float = 0.4
    mass: float = 0.8
    rest: float = 0.5
    joint_types: tuple[str, ...] = ('revolute', 'prismatic')

    def radius(self, q: Array) -> Array:
        return self.rest + q[:, 1]

    def inertia(self, q: Array) -> Array:
        return symmetric(self.beam + self.mass * self.radius(q) ** 2, 0.0, self.mass, q)

    def coriolis(self, q: Array, dq: Array) -> Array:
        r = self.mass * self.radius(q)
        return np.column_stack([2.0 * r * dq[:, 0] * dq[:, 1], -r * dq[:, 0] ** 2])

    def gravity(self, q: Array) -> Array:
        weight = self.mass * G
        return weight * np.column_stack([self.radius(q) * np.cos(q[:, 0]), np.sin(q[:, 0])])

    def potential(self, q: Array) -> Array:
        return self.mass * G * self.radius(q) * np.sin(q[:, 0])


@dataclass(frozen=True)
class TwoLinks(Arm):
    """The planar arm of every textbook; angles from the horizontal."""

    masses: tuple[float, float] = (1.2, 0.8)
    inertias: tuple[float, float] = (0.05, 0.03)
    length: float = 0.5
    centres: tuple[float, float] = (0.25, 0.2)
    joint_types: tuple[str, ...] = ('revolute', 'revolute')
    alpha: float = field(init=False)
    beta: float = field(init=False)
    delta: float = field(init=False)

    def __post_init__(self) -> None:
        (m1, m2), (i1, i2), (r1, r2) = self.masses, self.inertias, self.centres
        object.__setattr__(self, 'delta', i2 + m2 * r2**2)
        object.__setattr__(self, 'beta', m2 * self.length * r2)
        object.__setattr__(self, 'alpha', i1 + m1 * r1**2 + m2 * self.length**2)

    def inertia(self, q: Array) -> Array:
        coupling = self.delta + self.beta * np.cos(q[:, 1])
        first = self.alpha + self.delta + 2.0 * self.beta * np.cos(q[:, 1])
        return symmetric(first, coupling, self.delta, q)

    def coriolis(self, q: Array, dq: Array) -> Array:
        b, (d1, d2) = self.beta * np.sin(q[:, 1]), dq.T
        return np.column_stack([-b * (2.0 * d1 * d2 + d2**2), b * d1**2])

    def gravity(self, q: Array) -> Array:
        upper, lower = self._weights()
        far = lower * np.cos(q[:, 0] + q[:, 1])
        return np.column_stack([upper * np.cos(q[:, 0]) + far, far])

    def potential(self, q: Array) -> Array:
        upper, lower = self._weights()
        return upper * np.sin(q[:, 0]) + lower * np.sin(q[:, 0] + q[:, 1])

    def _weights(self) -> tuple[float, float]:
        (m1, m2), (r1, r2) = self.masses, self.centres
        return G * (m1 * r1 + m2 * self.length), G * m2 * r2


@dataclass(frozen=True)
class Slider(Arm):
    """A mass that is lifted along a vertical rail."""

    mass: float = 0.8
    joint_types: tuple[str, ...] = ('prismatic',)

    def inertia(self, q: Array) -> Array:
        return np.full((len(q), 1, 1), self.mass)

    def coriolis(self, q: Array, dq: Array) -> Array:
        return np.zeros_like(q)

    def gravity(self, q: Array) -> Array:
        return np.full_like(q, self.mass * G)

    def potential(self, q: Array) -> Array:
        return self.mass * G * q[:, 0]


def symmetric(first: Array | float, coupling: Array | float, second: float, q: Array) -> Array:
    entries = np.empty((len(q), 2, 2))
    entries[:, 0, 0], entries[:, 1, 1] = first, second
    entries[:, 0, 1] = entries[:, 1, 0] = coupling
    return entries


ARMS: dict[str, Arm] = {
    'polar': PolarArm(),
    'slider': Slider(),
    'two_links': TwoLinks(),
}


def random_motion(arm: Arm, n_samples: int, seed: int) -> tuple[Array, Array, Array]:
    """Draw q, dq, ddq: whole turns of revolute joints, 0.3 m to both sides of prismatic ones."""
    rng = np.random.default_rng(seed)
    reach = np.where([kind == 'prismatic' for kind in arm.joint_types], 0.3, np.pi)
    shape = (n_samples, len(arm.joint_types))
    q = reach * rng.uniform(-1.0, 1.0, shape)
    return q, 2.0 * rng.normal(size=shape), 5.0 * rng.normal(size=shape)


def noise_of(tau: Array, share: float = 1e-3, seed: int = 0) -> Array:
    """Draw measurement noise whose standard deviation is a share of each torque's."""
    noise = np.random.default_rng(seed).normal(size=tau.shape)
    return np.asarray(share * tau.std(axis=0) * noise)


def dataset_of(
    arm: Arm,
    motion: tuple[Array, Array, Array],
    tau: Array | None = None,
    gravity_compensated: bool = False,
) -> Dataset:
    q, dq, ddq = motion
    n = len(arm.joint_types)
    return Dataset(
        t=np.arange(float(len(q))),
        q=q,
        dq=dq,
        ddq=ddq,
        tau=arm.torque(*motion) if tau is None else tau,
        joint_names=tuple(f'joint_{i + 1}' for i in range(n)),
        joint_types=arm.joint_types,
        segment=np.zeros(len(q), dtype=np.int64),
        gravity_compensated=gravity_compensated,
    )
