"""What every storage file of a bag has to say, whatever its format."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Protocol


class DamageError(Exception):
    """A file, or a part of it, that cannot be read; says why in a few words."""


@dataclass(frozen=True)
class Channel:
    """One publisher's topic in one file, with its type as package/msg/Name."""

    id: int
    topic: str
    type: str
    encoding: str
    definition: str
    count: int

    @property
    def form(self) -> tuple[str, str, str]:
        """What its messages are read by."""
        return self.type, self.encoding, self.definition


class Storage(Protocol):
    """
    An open storage file.

    Attributes
    ----------
    notes : dict
        What is wrong with the file, one phrase each, in the order in which it was found; the
        values mean nothing.
    lost : Counter
        Messages that the file once had and cannot be read, by topic, as far as `messages` went.

    """

    notes: dict[str, None]
    lost: Counter[str]

    @property
    def channels(self) -> list[Channel]:
        """What the file holds."""

    def messages(self, ids: Collection[int]) -> Iterator[tuple[int, bytes]]:
        """Yield receive time [ns] and bytes of the messages of some channels, as they lie."""

    def close(self) -> None:
        """Close the file."""


def full_type(name: str) -> str:
    """Return package/msg/Name for a type that ROS 1 calls package/Name."""
    package, _, rest = name.partition('/')
    return name if '/' in rest or not rest else f'{package}/msg/{rest}'
