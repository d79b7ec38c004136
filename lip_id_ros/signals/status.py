"""The status of a node, and the counts of its messages: received is used plus refused."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from lip_id_ros.signals.joints import HARMLESS, Refusal, RefusedError

_FOREIGN = Refusal.FOREIGN_JOINTS


class Level(IntEnum):
    """As in diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Status:
    """The state of a node: its level, one sentence, and JSON-able values."""

    level: Level
    summary: str
    values: Mapping[str, Any] = field(default_factory=dict)


def in_words(counts: Mapping[str, int]) -> str:
    """Return keys and counts, in the order of the keys."""
    return ', '.join(f'{key} {n}' for key, n in sorted(counts.items()))


class Tally:
    """
    Counts of messages: every message received is used, or refused for a reason.

    `*uses`: what messages are used for: the keys of `used`. `used`: by use. `refused`: by reason,
    a value of `Refusal`.
    """

    def __init__(self, *uses: str) -> None:
        self.received = 0
        self.used = Counter(dict.fromkeys(uses, 0))
        self.refused: Counter[str] = Counter()
        self._n_used, self._judged = 0, Counter[str]()

    def take_new_refusals(self) -> Counter[str]:
        """
        Return refusals since the last call that deserve a warning, by reason.

        Those of `HARMLESS` do not, but for foreign joints where no message was used meanwhile.
        """
        new = self.refused - self._judged
        harmless = HARMLESS if self.used.total() > self._n_used else HARMLESS - {_FOREIGN}
        self._n_used, self._judged = self.used.total(), self.refused.copy()
        return Counter({reason: n for reason, n in new.items() if reason not in harmless})

    def refuse(self, reason: Refusal) -> None:
        """Count a refused message."""
        self.refused[reason.value] += 1

    def refuse_for(self, error: Exception) -> None:
        """Count a message as refused for the error that its use raised."""
        self.refuse(error.reason if isinstance(error, RefusedError) else Refusal.FAILED)

    @contextmanager
    def refusing(self) -> Iterator[None]:
        """Count the message as refused where the block raises."""
        try:
            yield
        except Exception as error:
            self.refuse_for(error)
            raise

    @contextmanager
    def receiving(self) -> Iterator[None]:
        """Count a message as received, and as refused where the block raises."""
        self.received += 1
        with self.refusing():
            yield
