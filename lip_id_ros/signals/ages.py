"""How old a message is when it is used, whatever clock its sender has."""

from __future__ import annotations

from lip_id_ros.signals.joint_states import NANOSECONDS

WINDOW = 1000
"""So many messages show how far apart two clocks are: more than wait after a pause."""

SAME_CLOCK_S = 10.0
"""A stamp further in the past is of another clock, and says nothing of the age."""


class AgeWatch:
    """
    Judge the ages of the messages of a topic by when they were sent.

    The clock of the sender may be that of another computer. The fastest of the last messages, at
    least `WINDOW` of them, shows how far it is from the clock of their receipt, so a clock that
    was set is followed.
    """

    def __init__(self) -> None:
        self._fastest: int | None = None
        self._before: int | None = None
        self._n = 0

    def age(self, sent_ns: int, received_ns: int, now_ns: int) -> float:
        """
        Return the age of the next message [s], 0 of one without a time of sending.

        `sent_ns`: by the clock of the sender [ns]; 0 where it is unknown. `received_ns`, `now_ns`:
        by the clock of this computer [ns].
        """
        if sent_ns <= 0:
            return 0.0
        if self._n == WINDOW:
            self._before, self._fastest, self._n = self._fastest, None, 0
        self._n += 1
        delay = (received_ns or now_ns) - sent_ns
        self._fastest = delay if self._fastest is None else min(delay, self._fastest)
        apart = self._fastest if self._before is None else min(self._fastest, self._before)
        return (now_ns - sent_ns - apart) / NANOSECONDS


def stamp_age(stamp_ns: int, now_ns: int) -> float:
    """Return the age of a stamp [s] by the clock `now_ns` [ns], 0 if it is of another clock."""
    age = (now_ns - stamp_ns) / NANOSECONDS
    return age if 0.0 <= age <= SAME_CLOCK_S else 0.0
