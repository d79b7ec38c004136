"""The last step before a torque leaves: scaled, finite and within each joint's limit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.errors import ConfigError
from lip_id_ros.runtime.references import Reason, RefusedError

Array = NDArray[np.float64]


class TorqueLimits:
    """
    Scale a torque and hold it within its joint's limit.

    Parameters
    ----------
    limits : sequence of float
        Largest magnitude per joint [N m or N], in the order of the model's joints; infinite where
        there is none.
    scale : float
        Factor on the torque before it is limited.

    Attributes
    ----------
    limited : int
        How many samples and points of plans were cut since these limits were set.

    """

    def __init__(self, limits: Sequence[float], scale: float) -> None:
        self._high = np.array(limits, dtype=np.float64)
        self._low = -self._high
        self._scale = scale
        self.limited = 0

    def apply(self, tau: Array) -> Array:
        """
        Scale and limit.

        Parameters
        ----------
        tau : ndarray, shape (n,) or (N, n)
            Torques [N m or N].

        Returns
        -------
        ndarray, shape as tau
            Within the limits.

        Raises
        ------
        RefusedError
            If a torque is not finite.

        """
        scaled = self._scale * tau
        if not np.isfinite(scaled).all():
            raise RefusedError(Reason.NOT_FINITE_TORQUE)
        safe = np.clip(scaled, self._low, self._high)
        self.limited += int(np.count_nonzero((safe != scaled).any(axis=-1)))
        return safe


def limits_by_name(
    limits: Sequence[float], limit_joints: Sequence[str], joint_names: Sequence[str]
) -> list[float]:
    """
    Bring limits into the order of the model's joints.

    Parameters
    ----------
    limits : sequence of float
        One per joint, one for all joints, or none: no limit.
    limit_joints : sequence of str
        The joints that `limits` are given for; empty: the model's.
    joint_names : sequence of str
        The model's joints.

    Returns
    -------
    list of float
        One per joint of the model.

    Raises
    ------
    ConfigError
        If their number is not that of the joints.

    """
    if not limits:
        return [np.inf] * len(joint_names)
    if len(limits) == 1:
        return list(limits) * len(joint_names)
    named = tuple(limit_joints) or tuple(joint_names)
    if len(limits) != len(named):
        raise ConfigError(
            f'torque_limits must hold one limit per joint ({len(named)}), one for all or none, '
            f'but holds {len(limits)}: give them in the order of {", ".join(named)}.'
        )
    by_name = dict(zip(named, limits, strict=True))
    return [by_name[name] for name in joint_names]
