"""Rate and age of what a node subscribes to."""

from __future__ import annotations

from collections import deque
import math
from typing import Any

from lip_id_ros.signals.status import Level, Status

DEAD_S = 2.0
"""A stream that came and is silent for longer is dead."""

WINDOW = 10
"""Rates are those of so many looks, which are half a second apart."""


class Stream:
    """
    Arrivals of one input.

    `lasting`: it goes on for as long as its sender lives, as joint states do and plans do not.
    """

    def __init__(self, lasting: bool) -> None:
        self._lasting = lasting
        self._count, self._at = 0, -math.inf
        self._looks: deque[tuple[float, int]] = deque(maxlen=WINDOW)

    def arrived(self, now: float) -> None:
        """Count a message."""
        self._count, self._at = self._count + 1, now

    def is_dead(self, now: float) -> bool:
        """Whether it came, and has ended."""
        return self._lasting and DEAD_S < now - self._at < math.inf

    def record(self, now: float) -> dict[str, Any]:
        """Add a look; return the rate since the first of the last [Hz], the newest's age [s]."""
        self._looks.append((now, self._count))
        since, before = self._looks[0]
        rate = (self._count - before) / (now - since) if now > since else 0.0
        age = round(now - self._at, 2) if self._count else None
        return {'rate_hz': round(rate, 1), 'age_s': age}


class Streams:
    """All inputs of a node, by their topics."""

    def __init__(self) -> None:
        self._of_topics: dict[str, Stream] = {}

    def add(self, topic: str, lasting: bool) -> Stream:
        """Return what counts an input."""
        return self._of_topics.setdefault(topic, Stream(lasting))

    def remove(self, topic: str) -> None:
        """Forget an input, if it is one."""
        self._of_topics.pop(topic, None)

    def status(self, now: float) -> Status:
        """Return rates and ages; stale where an input is dead."""
        values = {topic.lstrip('/'): each.record(now) for topic, each in self._of_topics.items()}
        dead = [topic for topic, each in self._of_topics.items() if each.is_dead(now)]
        if dead:
            return Status(Level.STALE, f'came, and are silent: {", ".join(dead)}', values)
        return Status(Level.OK, 'no input has fallen silent', values)
