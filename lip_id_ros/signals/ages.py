"""How old references are, by clocks of computers that may differ, and may be set."""

from __future__ import annotations

from lip_id_ros.signals.joint_states import NANOSECONDS
from lip_id_ros.signals.joints import Refusal, RefusedError

CLOCK_CONFIRMED_S, CLOCK_CONFIRMED_BY = 0.4, 5
"""So long, and in so many messages, another clock must show itself before it is believed."""

SPREAD_S = 0.1
"""
Delays of messages by one clock spread less. While a queue empties they fall faster: by its length
in the time that it takes.
"""


class AgeWatch:
    """
    Judge how long messages took, by the clock of their sender.

    That clock is taken for the one of this computer, until delays that stay the same show how far
    apart the two are. Single messages of another sender, and a queue that empties, show nothing.
    """

    def __init__(self) -> None:
        self._apart = 0
        self._since = self._low = self._high = self._n = 0

    def age(self, sent_ns: int, received_ns: int, now_ns: int) -> float:
        """
        Return the age of the next message [s]; of one that was sent at 0, since its receipt.

        Times are [ns]: of sending by the sender's clock, of receipt and now by that of this
        computer; a receipt at 0 is now.
        """
        received_ns = received_ns or now_ns
        waited_ns = now_ns - received_ns
        if sent_ns > 0:
            self._watch(received_ns - sent_ns, received_ns)
            waited_ns += max(0, received_ns - sent_ns - self._apart)
        return waited_ns / NANOSECONDS

    def _watch(self, delay: int, received_ns: int) -> None:
        low, high = min(self._low, delay), max(self._high, delay)
        if not self._n or high - low > SPREAD_S * NANOSECONDS or received_ns < self._since:
            self._since, self._n, low, high = received_ns, 0, delay, delay
        self._low, self._high, self._n = low, high, self._n + 1
        lasted = received_ns - self._since >= CLOCK_CONFIRMED_S * NANOSECONDS
        if lasted and self._n >= CLOCK_CONFIRMED_BY:
            self._apart = low
            self._n = 0


class ReferenceStamps:
    """
    Refuse stamps that go back: those of a second source, or of a message that was overtaken.

    A clock that was set back is believed once nothing else has come for `CLOCK_CONFIRMED_S`.
    """

    def __init__(self) -> None:
        self._newest_ns, self._at = 0, 0.0

    def require(self, stamp_ns: int, now: float) -> None:
        """Raise RefusedError if a stamp [ns] goes back, at a time on a steady clock [s]."""
        if stamp_ns < self._newest_ns and now - self._at < CLOCK_CONFIRMED_S:
            raise RefusedError(Refusal.BACKWARD_STAMP)

    def take(self, stamp_ns: int, now: float) -> None:
        """Take the stamp [ns] of an answered reference, at a time on a steady clock [s]."""
        self._newest_ns, self._at = stamp_ns, now
