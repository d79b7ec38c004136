"""Counts of `serve`: messages that were answered or refused, torques that were cut."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from lip_id_ros.signals.status import Tally

ALARMING = ('out_of_range', 'late_plans', 'sparse_plans')
"""Counts of torques and plans that deserve a warning."""


class ServeCounts:
    """Counts of messages and torques since the start of the node, `counted` by key."""

    def __init__(self, counted: Sequence[str]) -> None:
        self.references = Tally('samples', 'plans')
        self.joint_states = Tally('measured')
        self.torques = Counter(dict.fromkeys(counted, 0))
        self._judged: Counter[str] = Counter()

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

    def take_new_alarms(self) -> Counter[str]:
        """Return what deserves a warning and was counted since the last call."""
        doubtful = Counter({key: self.torques[key] for key in ALARMING})
        new, self._judged = doubtful - self._judged, doubtful
        states = self.joint_states.take_new_refusals()
        return (
            new
            + self.references.take_new_refusals()
            + Counter({f'joint states: {reason}': n for reason, n in states.items()})
        )
