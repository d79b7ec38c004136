"""
Counters and status of `serve`, and the watch for stale references.

A new counter is a field here, and is counted where it happens; ~/status has every value.

"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.signals.joints import HARMLESS, Refusal
from lip_id_ros.signals.status import Tally


class ServeCounts:
    """
    Counts of messages and torques since the start of the node.

    Attributes
    ----------
    references : Tally
        Samples of streams and plans.
    joint_states : Tally
    torques : Counter
        Torques that were cut (`limited`, `rate_limited`), doubtful references (`out_of_range`,
        `uncertain`) and streams that fell silent (`stale`).

    """

    def __init__(self) -> None:
        self.references = Tally('samples', 'plans')
        self.joint_states = Tally('measured')
        self.torques = Counter(limited=0, rate_limited=0, out_of_range=0, uncertain=0, stale=0)
        self._judged: Counter[str] = Counter()
        self._measured = 0

    def values(self) -> dict[str, Any]:
        """Return all counts, JSON-able."""
        references, joint_states = self.references, self.joint_states
        return {
            'received': {
                'references': references.received,
                'joint_states': joint_states.received,
            },
            'answered': {**references.used, **joint_states.used},
            **self.torques,
            'refused': dict(references.refused),
            'unmeasured': dict(joint_states.refused),
        }

    def new_alarms(self) -> Counter[str]:
        """Return what deserves a warning and was counted since the last call."""
        counted = {
            **self.references.refused,
            **{f'joint states: {key}': n for key, n in self.joint_states.refused.items()},
            **{key: self.torques[key] for key in ('out_of_range', 'uncertain')},
        }
        harmless = {*HARMLESS, *(f'joint states: {key}' for key in HARMLESS)}
        measured = self.joint_states.used['measured']
        if measured == self._measured:
            harmless.remove(f'joint states: {Refusal.FOREIGN_JOINTS}')
        self._measured = measured
        new, self._judged = Counter(counted) - self._judged, Counter(counted)
        return Counter({key: n for key, n in new.items() if key not in harmless})


class Watch:
    """
    Watch a stream of references from the first answered one on.

    Attributes
    ----------
    stale : bool
        Whether the silence was noticed.

    """

    def __init__(self) -> None:
        self.stale = False
        self._fed_at: float | None = None
        self._position: Array | None = None
        self._measured: Array | None = None
        self._measured_at = -np.inf

    def feed(self, now: float, position: Array) -> None:
        """
        Note an answered reference.

        Parameters
        ----------
        now : float
            [s], on any steady clock.
        position : ndarray, shape (n,)
            Its positions.

        """
        self._fed_at, self._position, self.stale = now, position, False

    def measure(self, now: float, position: Array) -> None:
        """Note where the arm is."""
        self._measured_at, self._measured = now, position

    def stop(self) -> None:
        """Expect no reference: the robot holds no torque."""
        self._fed_at, self.stale = None, False

    def silence(self, now: float) -> float:
        """Return the time since the last answered reference [s], 0 while none is expected."""
        return 0.0 if self._fed_at is None else now - self._fed_at

    def position(self, now: float, longest_s: float) -> Array | None:
        """Return where the arm is: measured no longer ago than so, else the last reference."""
        fresh = now - self._measured_at <= longest_s
        return self._measured if fresh else self._position
