"""Recordings of simulated arms whose drives have terms of friction beside the usual ones."""

from __future__ import annotations

import numpy as np

from benchmarks._arms import random_arm, RandomArm
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.conservative_terms import ripple, spring
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import (
    asymmetric,
    coulomb,
    load_coulomb,
    load_torque,
    load_viscous,
    offset,
    position_coulomb,
    presliding,
    quadratic,
    saturating,
    stribeck,
    Term,
    viscous,
)

N_JOINTS, JOINT = 3, 1
NOISE, WIDTH = 0.02, 0.05
COUPLED = Drive((2, 1), (1.0, 1.0))
LINK_STD = np.tile([5.0, *[2.0] * 3, *[1.0] * 7], (N_JOINTS, 1))
PLAIN = {'viscous', 'Coulomb', 'offset'}

Terms = list[tuple[DriveTerm, list[float]]]

PRESENT: dict[str, tuple[Term, list[float]]] = {
    'Stribeck': (stribeck(WIDTH), [0.0, 0.1, 0.0]),
    'saturating viscous': (saturating(WIDTH), [0.0, 0.4, 0.0]),
    'quadratic viscous': (quadratic(), [0.1]),
    'load-dependent Coulomb': (load_coulomb(WIDTH), [0.15]),
    'load-dependent viscous': (load_viscous(), [0.15]),
    'pre-sliding': (presliding(WIDTH, 1.0), [0.1]),
    'asymmetric': (asymmetric(WIDTH), [0.1, 0.1, 0.0, 0.0]),
    'position-dependent Coulomb': (position_coulomb(WIDTH), [0.1, 0.0, 0.0, 0.0]),
    'periodic once a turn': (ripple(1), [0.1, 0.1]),
    'periodic twice a turn': (ripple(2), [0.1, 0.1]),
    'ripple 9 times a turn': (ripple(9), [0.1, 0.05]),
    'joint spring': (spring(), [0.1]),
}
"""Terms of the second joint, with coefficients in standard deviations of the links' torque."""


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
        for term in (viscous(), coulomb(WIDTH), offset())
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
    return [(DriveTerm(COUPLED, term), [0.1]) for term in (viscous(), coulomb(WIDTH))]


def coupled_efforts() -> Terms:
    """Return what the second effort has of the third joint's torque: motors are coupled."""
    drive = Drive.transmitted(2, to=JOINT)
    return [(DriveTerm(drive, load_torque()), [0.7])]
