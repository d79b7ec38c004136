"""Counts of `serve`: messages that were answered or refused, torques that were cut."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from lip_id_ros.signals.joints import HARMLESS, Refusal
from lip_id_ros.signals.status import Tally

ALARMING = ('out_of_range', 'uncertain')
"""Counts of torques that deserve a warning."""


class ServeCounts:
    """
    Counts of messages and torques since the start of the node.

    Parameters
    ----------
    counted : sequence of str
        Keys of `torques`.

    Attributes
    ----------
    references : Tally
        Samples of streams and plans.
    joint_states : Tally
    torques : Counter
        Torques that were cut, doubtful references, and silences.

    """

    def __init__(self, counted: Sequence[str]) -> None:
        self.references = Tally('samples', 'plans')
        self.joint_states = Tally('measured')
        self.torques = Counter(dict.fromkeys(counted, 0))
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
            **{key: self.torques[key] for key in ALARMING},
        }
        harmless = {*HARMLESS, *(f'joint states: {key}' for key in HARMLESS)}
        measured = self.joint_states.used['measured']
        if measured == self._measured:
            harmless.remove(f'joint states: {Refusal.FOREIGN_JOINTS}')
        self._measured = measured
        new, self._judged = Counter(counted) - self._judged, Counter(counted)
        return Counter({key: n for key, n in new.items() if key not in harmless})
