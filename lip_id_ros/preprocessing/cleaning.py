"""Repeated and quantised samples, and the meaning of recorded efforts."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import ConfigError, SourceError
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.spill import column_array, release, row_blocks
from lip_id_ros.settings import RecordingSettings

Value = TypeVar('Value')

LEAST_REPETITION = 4
ON_GRID = 0.9
MOST_VALUES = 50_000


def stale(samples: JointSamples) -> BoolArray:
    """
    Mark samples that repeat the one before under a new stamp.

    A sample is stale if position and velocity of all joints are exactly those of the sample
    before although the arm moves; without recorded velocities, if position and effort are.

    Returns
    -------
    ndarray of bool, shape (N,)

    """
    same = repeated(samples.position)
    if not samples.has_velocity:
        return same & repeated(samples.effort)
    return same & repeated(samples.velocity) & _moving(samples.velocity)


def repeated(values: Array) -> BoolArray:
    """Mark rows that are equal to the one before."""
    same = np.zeros(len(values), bool)
    for block in row_blocks(len(values)):
        first = max(0, block.start - 1)
        some = values[first : block.stop]
        same[first + 1 : block.stop] = (some[1:] == some[:-1]).all(axis=1)
        release(values)
    return same


def _moving(velocity: Array) -> BoolArray:
    moving = np.zeros(len(velocity), bool)
    for block in row_blocks(len(velocity)):
        moving[block] = (velocity[block] != 0.0).any(axis=1)
        release(velocity)
    return moving


def quantum(values: Array) -> float:
    """
    Return the step of a quantised signal, 0 where there is none to be seen.

    Parameters
    ----------
    values : ndarray, shape (N,)

    """
    values = values[:: max(1, values.size // MOST_VALUES)]
    levels = np.unique(values)
    if levels.size < 2 or LEAST_REPETITION * levels.size > values.size:
        return 0.0
    steps = np.diff(levels)
    step = float(np.median(steps[steps <= 1.5 * np.percentile(steps, 20)]))
    multiples = steps / step
    on_grid = np.abs(multiples - np.round(multiples)) < 0.1
    return step if on_grid.mean() > ON_GRID else 0.0


def torque(samples: JointSamples, recording: RecordingSettings) -> Array:
    """
    Return recorded efforts as torques or forces, scaled and offset per joint.

    Returns
    -------
    ndarray, shape (N, n)
        [N m or N].

    Raises
    ------
    SourceError
        If no effort was recorded.
    ConfigError
        If scale or offset are not given for each joint.

    """
    if not samples.has_effort:
        raise SourceError(
            f'{samples.topic or "joint states"} in {samples.source} must have effort, but every '
            'message leaves it empty; record it with a driver that measures torque or current.'
        )
    scale = np.array(per_joint(samples, 'effort_scale', recording.effort_scale, 1.0))
    offset = np.array(per_joint(samples, 'effort_offset', recording.effort_offset, 0.0))
    if (scale == 1.0).all() and (offset == 0.0).all():
        return samples.effort
    scaled = column_array(samples.n_samples, samples.n_joints)
    for block in row_blocks(samples.n_samples):
        scaled[block] = samples.effort[block] * scale + offset
        release(scaled, samples.effort)
    return scaled


def per_joint(
    samples: JointSamples, name: str, values: tuple[Value, ...], default: Value
) -> tuple[Value, ...]:
    """
    Return one value for each joint: those given, or the default for all.

    Raises
    ------
    ConfigError
        If there are more or fewer than joints.

    """
    if not values:
        return (default,) * samples.n_joints
    if len(values) != samples.n_joints:
        raise ConfigError(
            f'recording.{name} must have one value for each of {", ".join(samples.joint_names)}, '
            f'not {len(values)}; give {samples.n_joints}.'
        )
    return values
