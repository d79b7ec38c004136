"""What a torque must keep to before it leaves, per joint of the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.signals.joints import by_joint


class Policy(StrEnum):
    """What is done with a reference that a check finds doubtful."""

    OFF = 'off'
    WARN = 'warn'
    SCALE = 'scale'
    ZERO = 'zero'


class SafeValue(StrEnum):
    """What is published when references stop."""

    ZERO = 'zero'
    GRAVITY = 'gravity'


@dataclass(frozen=True, eq=False)
class Rules:
    """
    The settings that hold for every torque, in the order of a model's joints.

    Attributes
    ----------
    limits : ndarray, shape (n,)
        Largest magnitude [N m or N], infinite where there is none.
    rates : ndarray, shape (n,)
        Largest change [N m/s or N/s], infinite where there is none.
    scale : float
        Factor on every torque.
    ramp_s : float
        Time to take over from what was sent before [s].
    gravity : bool
        Whether torques include gravity.
    stale_timeout_s : float
        Longest silence of a stream [s], infinite for any.
    safe_value : SafeValue
        What follows it.
    range_policy, std_policy : Policy
        What is done outside the training range, and beyond `std_limits`.
    margins : ndarray, shape (n,)
        How far a joint may leave its training range, as a share of half of it.
    std_limits : ndarray, shape (n,)
        Largest standard deviation of a torque [N m or N].

    """

    limits: Array
    rates: Array
    scale: float
    ramp_s: float
    gravity: bool
    stale_timeout_s: float
    safe_value: SafeValue
    range_policy: Policy
    margins: Array
    std_policy: Policy
    std_limits: Array


def make_rules(settings: ServeSettings, joint_names: Sequence[str]) -> Rules:
    """
    Bring the settings into the order of a model's joints.

    Raises
    ------
    ConfigError
        If a list has not one value per joint, or the check of standard deviations no limits.

    """
    require_consistent(settings)

    def per_joint(name: str, default: float) -> Array:
        values = getattr(settings, name)
        return by_joint(name, values, settings.joints, joint_names, default)

    return Rules(
        limits=per_joint('torque_limits', np.inf),
        rates=per_joint('rate_limits', np.inf),
        scale=settings.output_scale,
        ramp_s=settings.ramp_s,
        gravity=settings.gravity,
        stale_timeout_s=settings.stale_timeout_s or np.inf,
        safe_value=SafeValue(settings.stale_policy),
        range_policy=Policy(settings.range_policy),
        margins=per_joint('range_margin', 0.0),
        std_policy=Policy(settings.std_policy),
        std_limits=per_joint('std_limits', np.inf),
    )


def require_consistent(settings: ServeSettings) -> None:
    """
    Refuse settings that contradict each other for any arm.

    Raises
    ------
    ConfigError
        If the check of standard deviations has no limits.

    """
    if settings.std_policy != Policy.OFF and not settings.std_limits:
        raise ConfigError(
            'std_limits must hold a largest standard deviation where std_policy is '
            f'{settings.std_policy}, but it is empty; give one per joint or one for all.'
        )
