"""Messages that a node never took, by the numbers that publishers give their messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
import inspect
import time
from typing import Any


class Losses:
    """
    Count the messages of one subscription that were lost before the node took them.

    Of messages that are overwritten in a queue the middleware says nothing, but their numbers are
    missing. No message says which publisher it is of (rclpy gives no identifier): so gaps count
    only between messages that came while the graph had a single one; the middleware's own count
    does where it is larger. `uncounted`: there are several publishers, or messages have no
    numbers.
    """

    uncounted = False

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self._last: int | None = None
        self._missing = self._since_ns = 0
        self._went_back = self._unnumbered = False
        self._publishers: Set[bytes] = frozenset()
        self._by_number = self._by_event = self._counted = 0

    def noting(self, callback: Callable[..., None]) -> Callable[[Any, Mapping[str, Any]], None]:
        """Return a callback that notes the number of each message."""
        wants_info = len(inspect.signature(callback).parameters) > 1

        def called(message: Any, info: Mapping[str, Any]) -> None:
            self.note(info)
            if wants_info:
                callback(message, info)
            else:
                callback(message)

        return called

    def note(self, info: Mapping[str, Any]) -> None:
        """Note a message by what the middleware says of it; twice the same counts once."""
        number = info['publication_sequence_number']
        self._unnumbered = number is None
        if number is None or info['received_timestamp'] < self._since_ns:
            return  # of a middleware without numbers, or perhaps of a publisher that has ended
        if self._last is not None and number != self._last + 1:
            self._missing += max(0, number - self._last - 1)
            self._went_back |= number < self._last
        self._last = number

    def on_event(self, event: Any) -> None:
        """Count what the middleware says that it lost; numbers may tell of the same messages."""
        self._by_event += event.total_count_change

    def settle(self, publishers: Set[bytes]) -> int:
        """Return how many messages were lost since the last call, given the ids of publishers."""
        several = len(self._publishers | publishers) > 1
        self.uncounted = several or self._unnumbered
        single = len(self._publishers | publishers) == 1 and not self._went_back
        if single:
            self._by_number += self._missing
        lost = max(self._by_number, self._by_event)
        new, self._counted = lost - self._counted, lost
        if not single:  # begin anew
            self._by_number = self._by_event = lost
            self._last, self._since_ns = None, time.time_ns()
        self._since_ns = min(self._since_ns, time.time_ns())  # the clock was set back
        self._missing, self._went_back = 0, False
        self._publishers = publishers or self._publishers  # the last one may have ended
        return new
