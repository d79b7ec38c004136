"""Raw joint samples, as they were recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lip_id_ros.arrays import Array


@dataclass(frozen=True, eq=False)
class JointSamples:
    """
    Samples of one recording in the order of time, N samples of n joints, nothing invented.

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time since the first sample [s], strictly increasing.
    position, velocity, effort : ndarray, shape (N, n)
        As recorded [rad or m, rad/s or m/s, any unit]; velocity or effort is NaN throughout where
        the recording has none.
    joint_names : tuple of str
        Names of the n columns.
    start_s : float
        Stamp of the first sample [s].
    counts : mapping
        Messages that were dropped, by reason.
    source, topic : str
        Where the samples come from.
    seen_joints : tuple of str
        Joints of all messages, also of those dropped.
    clock : str
        Whether the times are those of the message headers or of reception.
    notes : tuple of str
        What else is to be known, a phrase each: damage of the files, what was put in order.

    """

    t: Array
    position: Array
    velocity: Array
    effort: Array
    joint_names: tuple[str, ...]
    start_s: float = 0.0
    counts: Mapping[str, int] = field(default_factory=dict)
    source: str = 'the recording'
    topic: str = ''
    seen_joints: tuple[str, ...] = ()
    clock: str = 'header'
    notes: tuple[str, ...] = ()

    @property
    def n_samples(self) -> int:
        """Number of samples N."""
        return int(self.t.size)

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    @property
    def has_velocity(self) -> bool:
        """Whether velocities were recorded."""
        return not np.isnan(self.velocity).any()

    @property
    def has_effort(self) -> bool:
        """Whether efforts were recorded."""
        return not np.isnan(self.effort).any()
