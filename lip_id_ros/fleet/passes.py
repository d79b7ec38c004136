"""A pass over a fleet: results that a cache has are taken from there, others from an engine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
import hashlib
import json
from typing import Any, Protocol, TypeVar

from lip_id_ros.checked_file import Packable
from lip_id_ros.errors import DataError
from lip_id_ros.fleet.engines import Engine, Outcome
from lip_id_ros.fleet.results import Refusal
from lip_id_ros.progress import Progress

Kept = TypeVar('Kept', bound=Packable)


class Source(Protocol):
    """A recording somewhere; picklable."""

    @property
    def name(self) -> str:
        """Address, as people know it."""

    @property
    def group(self) -> str:
        """Robot."""

    @property
    def fingerprint(self) -> str:
        """Text that changes with the content, for the cache; need not be that of the samples."""

    def local(self) -> AbstractContextManager[str]:
        """Give the path of a local copy while the context lasts."""


class Cache(Protocol):
    """Keeps bytes under keys, as a dictionary does."""

    def get(self, key: str, /) -> bytes | None:
        """Return what is kept under a key; None where there is nothing."""

    def __setitem__(self, key: str, content: bytes, /) -> None:
        """Keep bytes; whole or not at all."""


@dataclass(frozen=True)
class Passes:
    """Runs passes: results that the cache has are taken from there, the others from the engine."""

    engine: Engine
    cache: Cache
    progress: Progress

    def run(
        self,
        kind: type[Kept],
        function: Callable[[Any], Kept],
        items: Sequence[Any],
        keys: Sequence[str],
        stage: str,
    ) -> tuple[dict[int, Kept], dict[int, str]]:
        """
        Run a function for each item, with a key of the cache.

        What it refuses is not tried again. Returns results, and why there is none of the other
        items, both by number of the item.
        """
        results, reasons = dict[int, Kept](), dict[int, str]()
        for k, key in enumerate(keys):
            if (known := self.restored(kind, key)) is not None:
                results[k] = known
            elif (refusal := self.restored(Refusal, key)) is not None:
                reasons[k] = refusal.reason
        rest = [k for k in range(len(items)) if k not in results and k not in reasons]

        def keep(place: int, value: Kept) -> None:
            self.keep(keys[rest[place]], value)

        outcomes = self.map(function, [items[k] for k in rest], stage, keep)
        for k, outcome in zip(rest, outcomes, strict=True):
            if outcome.value is not None:
                results[k] = outcome.value
                continue
            reasons[k] = outcome.reason
            if outcome.is_final:
                self.keep(keys[k], Refusal(outcome.reason))
        return results, reasons

    def map(
        self,
        function: Callable[[Any], Any],
        items: Sequence[Any],
        stage: str,
        keep: Callable[[int, Any], None] = lambda place, value: None,
    ) -> list[Outcome]:
        """Return the outcomes of a function for each of many items, in their order."""

        def progress(_: str, done: int, total: int) -> None:
            self.progress(stage, done, total)

        return self.engine.map(function, items, progress, keep)

    def keep(self, key: str, value: Packable) -> None:
        """Keep a result under a key."""
        self.cache[f'{key}.{value.KIND}'] = value.to_bytes()

    def restored(self, kind: type[Kept], key: str) -> Kept | None:
        """Return what the cache has under a key; None where it has nothing, or a damaged entry."""
        content = self.cache.get(f'{key}.{kind.KIND}')
        try:
            return None if content is None else kind.from_bytes(content)
        except DataError:
            return None


def digest(*values: Any) -> str:
    """Return a text that changes with values of dataclasses, texts, numbers and lists of them."""
    text = json.dumps(values, sort_keys=True, default=vars)
    return hashlib.sha256(text.encode()).hexdigest()
