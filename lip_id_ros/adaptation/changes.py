"""What of an arm has changed since its fit, in torques that a roboticist knows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from lip_id_ros.adaptation.adaptation import Adaptation
from lip_id_ros.arrays import Array
from lip_id_ros.joint_types import POSITION_UNITS, TORQUE_UNITS

SURE = 4.0
"""Deviations beyond which a torque has changed."""

LARGE = 0.1
"""Least change that is named, as a share of the friction of the joint."""


@dataclass(frozen=True)
class Change:
    """
    A torque [`unit`] that has changed; `std` is the deviation of the difference.

    `share`: the change in the friction of the joint.
    """

    joint: str
    what: str
    unit: str
    before: float
    now: float
    std: float
    share: float

    @property
    def deviations(self) -> float:
        """The change in its standard deviations."""
        return abs(self.now - self.before) / self.std

    def sentence(self) -> str:
        """Return what has changed."""
        return (
            f'{self.joint}: {self.what} was {self.before:.3g} and is {self.now:.3g} {self.unit} '
            f'({self.deviations:.0f} standard deviations).'
        )

    def to_json(self) -> dict[str, Any]:
        """Return the change for other programs."""
        return {**asdict(self), 'deviations': self.deviations}


def friction_at_speed(adaptation: Adaptation) -> tuple[Array, Array]:
    """
    Return the friction of each joint at a usual speed, and its deviation, (n,) [N m or N].

    Half the difference of the torques forwards and backwards: without constant torques.

    """
    forwards, backwards = adaptation.arm.friction_at_speed()
    return _torques(adaptation, 0.5 * (forwards - backwards), adaptation.covariance)


def _torques(adaptation: Adaptation, features: Array, covariance: Array) -> tuple[Array, Array]:
    """Return torques now, and their deviations by a covariance, for features (n, K)."""
    first = len(covariance) - features.shape[1]
    own = covariance[first:, first:]
    variance = np.einsum('jk,kl,jl->j', features, own, features)
    std = np.sqrt(np.maximum(variance, np.finfo(np.float64).tiny))
    return features @ adaptation.numbers[adaptation.arm.friction], std


def changes(adaptation: Adaptation) -> list[Change]:
    """Return the friction and the constant torques that have surely changed since the fit."""
    arm, model = adaptation.arm, adaptation.commissioned
    forwards, backwards = arm.friction_at_speed()
    kinds = (
        ('friction', 0.5 * (forwards - backwards)),
        ('torque without direction', 0.5 * (forwards + backwards)),
    )
    found = []
    for what, features in kinds:
        before = features @ arm.start[arm.friction]
        now, std = _torques(adaptation, features, adaptation.covariance + arm.covariance)
        sure = np.abs(now - before) > np.maximum(SURE * std, LARGE * arm.friction_size)
        for j in np.flatnonzero(sure).tolist():
            kind = model.joint_types[j]
            at = f'{what} at {arm.speed[j]:.2g} {POSITION_UNITS[kind]}/s'
            share = abs(now[j] - before[j]) / arm.friction_size[j]
            values = float(before[j]), float(now[j]), float(std[j]), float(share)
            found.append(Change(model.joint_names[j], at, TORQUE_UNITS[kind], *values))
    return sorted(found, key=lambda each: model.joint_names.index(each.joint))


def change_lines(found: Sequence[Change]) -> list[str]:
    """Return sentences, one for each change, or that there is none."""
    if not found:
        return ['No friction now differs surely from that of the fit by a tenth or more.']
    return [each.sentence() for each in found]
