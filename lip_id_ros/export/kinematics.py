"""The Denavit-Hartenberg parameters of an arm, and which of them the data identify."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.denavit_hartenberg import PARAMETERS, table, UNITS, with_standard_frames

HEADER = tuple(f'{name} [{unit}]' for name, unit in zip(PARAMETERS, UNITS, strict=True))
TRANSFORM = 'Rot_x(twist) Trans_x(length) Rot_z(angle) Trans_z(offset)'
KEYS = tuple(f'{name}_{unit}' for name, unit in zip(PARAMETERS, UNITS, strict=True))
STD_KEYS = tuple(f'{name}_std_{unit}' for name, unit in zip(PARAMETERS, UNITS, strict=True))
IS_DISTANCE = np.array(UNITS) == 'm'

LEAST_ANGLE, LEAST_DISTANCE, HALF = 15.0, 0.05, 0.5
"""Three deviations below these [deg, m], or below half of a distance, leave it identified."""
TILT = 'tilt [deg]'
TILTED = 1e-4
"""Tilt of a frame that is worth a column [deg]."""
MARK = '?'
UNIDENTIFIED = (
    f'{MARK} marks a number that the data do not identify: three standard deviations exceed 15 '
    'degrees, or 5 cm and half of it. Arms with other numbers there have the same torques.'
)


@dataclass(frozen=True, eq=False)
class Kinematics:
    """
    Denavit-Hartenberg parameters of the joints of an arm.

    `values`, shape (n, 4): twist, length, angle, offset [deg, m, deg, m], with their standard
    deviations `std`: nan where they are unknown, infinite where torques do not determine a
    parameter. `tilt`, shape (n,): about the y axis, where neighbouring axes are nearly parallel
    [deg].
    """

    joint_names: tuple[str, ...]
    values: Array
    std: Array
    tilt: Array

    @property
    def identified(self) -> BoolArray:
        """Which parameters the data identify, shape (n, 4); all without deviations."""
        distances = np.maximum(HALF * np.abs(self.values), LEAST_DISTANCE)
        return np.asarray(~(3.0 * self.std >= np.where(IS_DISTANCE, distances, LEAST_ANGLE)))

    @property
    def is_tilted(self) -> bool:
        """Whether a frame is tilted, so that four parameters do not give the chain."""
        return bool((np.abs(self.tilt) > TILTED).any())

    @property
    def transform(self) -> str:
        """The order of the parameters' transforms."""
        return TRANSFORM.replace(' Rot_z', ' Rot_y(tilt) Rot_z') if self.is_tilted else TRANSFORM

    @property
    def header(self) -> tuple[str, ...]:
        """Names of the parameters, the tilt among them where there is one."""
        return (*HEADER, *[TILT] * self.is_tilted)

    def cells(self) -> list[tuple[str, ...]]:
        """Return name and parameters of each joint as text, with deviations."""
        rows = zip(self.joint_names, self.values, self.std, self.identified, strict=True)
        return [
            (name, *(_cell(*each) for each in zip(UNITS, *columns, strict=True)))
            + (_rounded(tilt, 'deg', 2, 4),) * self.is_tilted
            for (name, *columns), tilt in zip(rows, self.tilt, strict=True)
        ]

    def lines(self) -> list[str]:
        """Return the table as lines of text, for comments in files."""
        units = (*UNITS, *['deg'] * self.is_tilted)
        width = max(len(name) for name in self.joint_names)
        head = ''.join(f'{name:>14}' for name in self.header)
        known = np.column_stack([self.identified, np.ones_like(self.tilt, dtype=bool)])
        rows = zip(self.joint_names, np.column_stack([self.values, self.tilt]), known, strict=True)
        lines = [f'Denavit-Hartenberg: {self.transform}', f'{"":{width}}{head}']
        for name, *columns in rows:
            cells = zip(units, *(column[: len(units)] for column in columns), strict=True)
            numbers = ''.join(
                f'{_rounded(value, unit, 3, 5):>13}{" " if sure else MARK}'
                for unit, value, sure in cells
            )
            lines.append(f'{name:{width}}{numbers}'.rstrip())
        return lines

    def to_json(self) -> dict[str, dict[str, Any]]:
        """Return parameters, deviations and the names of unidentified ones, joint by joint."""
        known = np.where(np.isfinite(self.std), self.std, None).tolist()  # type: ignore[call-overload]
        return {
            name: {
                **dict(zip(KEYS, (np.round(values, 5) + 0.0).tolist(), strict=True)),
                **dict(zip(STD_KEYS, std, strict=True)),
                'tilt_deg': round(tilt, 5) + 0.0,
                'not_identified': [x for x, sure in zip(PARAMETERS, yes, strict=True) if not sure],
            }
            for name, values, std, yes, tilt in zip(
                self.joint_names,
                self.values,
                known,
                self.identified,
                self.tilt.tolist(),
                strict=True,
            )
        }


def model_kinematics(model: InverseDynamicsModel) -> Kinematics | None:
    """Return the parameters of a model's arm, None where it has no links; errors as below."""
    if model.arm is None:
        return None
    chain, _ = with_standard_frames(model.arm.chain, model.arm.links)
    return kinematics_of(model.joint_names, chain, model.summary)


def kinematics_of(
    joint_names: Sequence[str], chain: Chain, summary: Mapping[str, Any]
) -> Kinematics:
    """
    Return the parameters of a chain, with the deviations that the summary of a fit has.

    Without gravity torques determine distances up to a common factor, so that none is identified
    unless a robot description gave it. The chain is in frames of Denavit and Hartenberg.
    ValueError if the deviations are not those of this arm.
    """
    found, shape = table(chain), (len(joint_names), len(PARAMETERS))
    reported = summary.get('denavit_hartenberg', {})
    std = np.full(shape, np.nan)
    if all(key in reported for key in STD_KEYS):
        std = np.array([reported[key] for key in STD_KEYS], dtype=np.float64).T
    if std.shape != shape:
        raise ValueError(f'deviations of shape {std.shape} for {len(joint_names)} joints')
    if not chain.gravity.any() and 'description' not in summary:
        std[(std > 0.0) & IS_DISTANCE] = np.inf  # those of 0 are so by the convention
    return Kinematics(tuple(joint_names), found.reported, std, np.degrees(found.tilt))


def _cell(unit: str, value: float, std: float, identified: bool) -> str:
    text = _rounded(value, unit, 2, 4)
    if 0.0 < std < math.inf:
        text += f' ± {_rounded(std, unit, 2, 4)}'
    return text if identified else f'{text} {MARK}'


def _rounded(value: float, unit: str, angle: int, distance: int) -> str:
    digits = angle if unit == 'deg' else distance
    return f'{round(value, digits) + 0.0:.{digits}f}'
