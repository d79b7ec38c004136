"""Small simulated fleets: recordings of robots of one type with friction of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
import hashlib
from pathlib import Path
from typing import Any

from gp.chains import ChainArm, random_arm
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.fleet.engines import attempt, Engine, Outcome
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.progress import Progress

TYPES = ('revolute', 'revolute')

WIDTH = 0.05
"""Of the smooth sign of Coulomb friction [rad/s]."""


@dataclass(frozen=True)
class FileSource:
    name: str
    group: str

    @property
    def fingerprint(self) -> str:
        return hashlib.sha256(Path(self.name).read_bytes()).hexdigest()

    @contextmanager
    def local(self) -> Iterator[str]:
        yield self.name


@dataclass
class PlainEngine(Engine):
    """Runs items one after another in this process, and counts them."""

    counts: list[int] = field(default_factory=list)

    def __exit__(self, *error: object) -> None:
        """Do nothing."""

    def map(
        self,
        function: Callable[[Any], Any],
        items: Sequence[Any],
        progress: Progress,
        keep: Callable[[int, Any], None],
    ) -> list[Outcome]:
        self.counts.append(len(items))
        outcomes: list[Outcome] = []
        for number, item in enumerate(items):
            outcomes.append(attempt(function, item))
            if not outcomes[number].reason:
                keep(number, outcomes[number].value)
            progress('', number + 1, len(items))
        return outcomes


def arm_of(seed: int = 3, joint_types: tuple[str, ...] = TYPES) -> ChainArm:
    return random_arm(joint_types, seed, 9.80665)


def friction_of(arm: ChainArm, rng: np.random.Generator, spread: float) -> Array:
    """Return viscous and Coulomb coefficients and offsets, shape (n, 3)."""
    mean = np.tile([0.3, 0.8, 0.2], (len(arm.joint_types), 1))
    return np.asarray(mean * (1.0 + spread * rng.standard_normal(mean.shape)))


def recording(
    arm: ChainArm, friction: Array, seed: int, count: int = 400, noise: float = 0.02
) -> Dataset:
    """Return samples at 50 Hz of a motion with a few frequencies, drawn by seed."""
    rng = np.random.default_rng(seed)
    n = len(arm.joint_types)
    t = np.arange(count) / 50.0
    omega = 2.0 * np.pi * rng.uniform(0.1, 0.9, (5, n))
    phase, size = rng.uniform(0.0, 2.0 * np.pi, (5, n)), rng.uniform(0.2, 0.6, (5, n))
    angle = omega * t[:, None, None] + phase
    q = np.sum(size * np.sin(angle), axis=1)
    dq = np.sum(size * omega * np.cos(angle), axis=1)
    ddq = -np.sum(size * omega**2 * np.sin(angle), axis=1)
    tau = arm.torque(q, dq, ddq) + friction_torque(friction, dq)
    return Dataset(
        t=t,
        q=q,
        dq=dq,
        ddq=ddq,
        tau=tau + noise * rng.standard_normal(tau.shape),
        joint_names=tuple(f'joint_{k}' for k in range(n)),
        joint_types=arm.joint_types,
        segment=np.zeros(count, np.int64),
        tau_noiseless=tau,
    )


def friction_torque(friction: Array, dq: Array) -> Array:
    viscous, coulomb, offset = friction.T
    return np.asarray(viscous * dq + coulomb * np.tanh(dq / WIDTH) + offset)


def save(data: Dataset, path: Path, group: str) -> FileSource:
    data.save(path)
    return FileSource(str(path), group)


def linearisation_of(arm: ChainArm, data: Dataset) -> Linearisation:
    """Return the true arm with its plain friction, as what statistics are gathered with."""
    n = len(arm.joint_types)
    basis = plain_friction(n, np.full(n, WIDTH))
    coefficients = np.tile([0.3, 0.8, 0.2], n)
    return Linearisation(
        data.joint_names,
        arm.chain,
        arm.parameters,
        FrictionModel(basis, coefficients),
        TorqueNoise.constant(np.full(n, 0.02)),
    )
