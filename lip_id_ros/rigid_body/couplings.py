"""
Coupled positions, as of parallelograms, wrists and belts (maths.md, section 10).

The joints of the chain move by C times the reported positions; by virtual work reported torques
are C^T times those of the chain.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.rigid_body.chain import Chain, NO_COUPLINGS

LEAST_DETERMINANT = 1e-3
"""Of C: below it reported positions hardly say where the joints are."""

NO_COUPLING = 'none'
"""Of the setting: positions are those of the joints, and nothing is searched for."""

FORM = 'a coupling is "joint ratio other_joint", such as "joint_3 -1 joint_2"'


class Coupling(NamedTuple):
    """
    A joint that moves by its reported position plus a ratio times that of another one.

    Joints are numbered from 0; the ratio has the unit of the joint over that of the other one.
    """

    joint: int
    other: int
    ratio: float


def rows_of(couplings: Sequence[Coupling]) -> Array:
    """Return couplings as `Chain` has them, shape (k, 3)."""
    return np.array(couplings, dtype=np.float64).reshape(-1, 3) if couplings else NO_COUPLINGS


def couplings_of(rows: Array) -> tuple[Coupling, ...]:
    """Return the couplings that `rows_of` gave."""
    return tuple(Coupling(int(row[0]), int(row[1]), float(row[2])) for row in rows)


def coupling_matrix(chain: Chain) -> Array:
    """Return C, shape (n, n): the joints move by C times the reported positions."""
    matrix = np.eye(len(chain.prismatic))
    for joint, other, ratio in couplings_of(chain.couplings):
        matrix[joint, other] += ratio
    return matrix


def contradiction(couplings: Sequence[Coupling], n_joints: int) -> str:
    """Return what is wrong with couplings of n joints; empty where nothing is."""
    matrix = np.eye(n_joints)
    for joint, other, ratio in couplings:
        if not (0 <= joint < n_joints and 0 <= other < n_joints and joint != other):
            return f'joints {joint} and {other}, which are no two of {n_joints} joints'
        if not np.isfinite(ratio) or ratio == 0.0:
            return f'a ratio of {ratio:g}, which must be finite and not zero'
        if matrix[joint, other] != 0.0:
            return f'two couplings of joint {joint} with joint {other}'
        matrix[joint, other] = ratio
    if abs(np.linalg.det(matrix)) < LEAST_DETERMINANT:
        return 'couplings from which the positions of the joints do not follow'
    return ''


def read_couplings(texts: Sequence[str], joint_names: Sequence[str]) -> tuple[Coupling, ...]:
    """
    Return the couplings that a setting has, from texts "joint ratio other_joint".

    ConfigError if one has another form, names an unknown joint, or contradicts the others.
    """
    found = tuple(_read(text, joint_names) for text in texts)
    if problem := contradiction(found, len(joint_names)):
        raise ConfigError(
            f'fit.coupling must hold couplings that fit together, but {list(texts)} has '
            f'{problem}; {FORM}.'
        )
    return found


def _read(text: str, joint_names: Sequence[str]) -> Coupling:
    parts = text.split()
    if len(parts) != 3:
        raise ConfigError(f'fit.coupling has {text!r} in it, but {FORM}.')
    joint, ratio, other = parts
    for name in (joint, other):
        if name not in joint_names:
            raise ConfigError(
                f'fit.coupling has {text!r} in it, but the recording has no joint {name!r}; its '
                f'joints are {", ".join(joint_names)}.'
            )
    try:
        value = float(ratio)
    except ValueError:
        raise ConfigError(
            f'fit.coupling has {text!r} in it, but {ratio!r} is no number; {FORM}.'
        ) from None
    return Coupling(joint_names.index(joint), joint_names.index(other), value)


def coupling_texts(chain: Chain, joint_names: Sequence[str]) -> list[str]:
    """Return the couplings of an arm in the form that `read_couplings` reads."""
    return [
        f'{joint_names[joint]} {ratio:g} {joint_names[other]}'
        for joint, other, ratio in couplings_of(chain.couplings)
    ]
