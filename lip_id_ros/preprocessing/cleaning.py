"""Samples that say nothing new, and the meaning of recorded efforts."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import ConfigError, SourceError
from lip_id_ros.recording.joint_samples import JointSamples
from lip_id_ros.settings import RecordingSettings

Value = TypeVar('Value')


def stale(samples: JointSamples) -> BoolArray:
    """
    Mark samples that repeat the one before under a new stamp.

    A sample is stale if position and velocity of all joints are exactly those of the sample
    before although the arm moves; without recorded velocities, if position and effort are.

    Returns
    -------
    ndarray of bool, shape (N,)

    """
    if samples.has_velocity:
        moving = (samples.velocity[1:] != 0.0).any(axis=1)
        repeated = _repeated(samples.position) & _repeated(samples.velocity) & moving
    else:
        repeated = _repeated(samples.position) & _repeated(samples.effort)
    return np.concatenate([np.zeros(min(1, samples.n_samples), bool), repeated])


def chosen(samples: JointSamples, keep: BoolArray) -> JointSamples:
    """Return some of the samples."""
    return replace(
        samples,
        t=samples.t[keep],
        position=samples.position[keep],
        velocity=samples.velocity[keep],
        effort=samples.effort[keep],
    )


def _repeated(values: Array) -> BoolArray:
    same: BoolArray = (values[1:] == values[:-1]).all(axis=1)
    return same


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
    scale = per_joint(samples, 'effort_scale', recording.effort_scale, 1.0)
    offset = per_joint(samples, 'effort_offset', recording.effort_offset, 0.0)
    scaled: Array = samples.effort * np.array(scale) + np.array(offset)
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
