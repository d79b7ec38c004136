"""What the parameters of `train` must satisfy together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lip_id_ros.errors import ConfigError

PER_JOINT = ('recording.joint_types', 'recording.effort_scale', 'recording.effort_offset')


def check_together(values: Mapping[str, Any]) -> None:
    """
    Check what no parameter can tell alone.

    Parameters
    ----------
    values : mapping
        Every parameter of `train` by name.

    Raises
    ------
    ConfigError
        If a joint is named twice, a list has not one value for each joint, or a bag is absent.

    """
    joints = values['recording.joints']
    for name in joints:
        if joints.count(name) > 1:
            raise ConfigError(
                f'recording.joints must name each joint once, but {name!r} comes twice.'
            )
    for name in PER_JOINT:
        count = len(values[name])
        if joints and count not in (0, len(joints)):
            raise ConfigError(
                f'{name} must have one value for each of the {len(joints)} recording.joints, not '
                f'{count}; complete it, or leave it empty.'
            )
    for path in values['bags']:
        if not Path(path).exists():
            raise ConfigError(
                f'bags must be recordings or data sets, but {path} does not exist; correct the '
                'path, which is relative to the folder in which the node was started.'
            )
