"""How often in a turn the torque of a gear or motor ripples (maths.md, section 12)."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.joint_types import REVOLUTE

FIRST, LAST = 8, 400
"""
Harmonics that are looked for. Slower ones could stand in for gravity; a strain wave gear has two
periods in a turn of its motor, which are some hundred in a turn of the joint.
"""

MOST_SAMPLES = 2000
"""Of a periodogram; of more, so many evenly chosen."""

DEPENDENT = 1e-6
"""Least share of a harmonic's square that other features leave."""


def resolved_harmonics(dataset: Dataset, joint: int) -> IntArray:
    """
    Return the harmonics of which a joint covers a period, and which the sampling shows.

    Between half of the neighbouring samples their phase changes by less than a quarter period.
    """
    if dataset.joint_types[joint] != REVOLUTE:
        return np.empty(0, dtype=np.int64)
    q = dataset.q[:, joint]
    harmonics = np.arange(FIRST, LAST + 1)
    covered = harmonics * np.ptp(q) > 2.0 * np.pi
    shown = harmonics * np.median(np.abs(np.diff(q))) < 0.5 * np.pi
    return np.asarray(harmonics[covered & shown])


def strongest_harmonic(q: Array, torque: Array, features: Array, harmonics: IntArray) -> int:
    """
    Return the harmonic that explains most of a torque (N,) beside features (N, p).

    A least-squares periodogram (Lomb, Astrophysics and Space Science 1976) in the position [rad].
    Torque and features are weighted by the roots of the samples' weights, the last feature.
    """
    rows = evenly(len(q), MOST_SAMPLES)
    basis, _ = np.linalg.qr(features[rows])

    def beside(values: Array) -> Array:
        return values - basis @ (basis.T @ values)

    angle, root = np.outer(q[rows], harmonics), features[rows, -1:]
    cosine, sine = beside(root * np.cos(angle)), beside(root * np.sin(angle))
    rest = beside(torque[rows])
    aa, ab, bb = (
        np.sum(x * y, axis=0) for x, y in ((cosine, cosine), (cosine, sine), (sine, sine))
    )
    ra, rb = rest @ cosine, rest @ sine
    determinant = aa * bb - ab**2
    usable = determinant > DEPENDENT * (root**2).sum() ** 2
    squares = np.where(usable, bb * ra**2 - 2.0 * ab * ra * rb + aa * rb**2, 0.0)
    return int(harmonics[np.argmax(squares / np.where(usable, determinant, 1.0))])
