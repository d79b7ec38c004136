"""A pass over a fleet: results that a cache has are taken from there, others from an engine."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
import hashlib
import json
from typing import Any, Protocol, TypeVar

from lip_id_ros.errors import DataError
from lip_id_ros.fleet.engines import Engine
from lip_id_ros.fleet.results import Packable
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
    """Keeps named arrays under a key."""

    def get(self, key: str) -> Mapping[str, Any] | None:
        """Return the arrays of a key; None where there are none."""

    def put(self, key: str, arrays: Mapping[str, Any]) -> None:
        """Keep arrays; whole or not at all."""


class NoCache:
    """Keeps nothing."""

    def get(self, key: str) -> Mapping[str, Any] | None:
        """Return None."""

    def put(self, key: str, arrays: Mapping[str, Any]) -> None:
        """Keep nothing."""


@dataclass(frozen=True)
class Passes:
    """
    Runs passes: results that the cache has are taken from there, the others from the engine.

    Attributes
    ----------
    engine : Engine
    cache : Cache
    progress : callable

    """

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
        Run a function for each of many items.

        Parameters
        ----------
        kind : type
            Of its results.
        function : callable
        items : sequence
        keys : sequence of str
            Under which the cache has the result of each item.
        stage : str
            Name of the pass for progress.

        Returns
        -------
        results : dict
            By number of the item.
        reasons : dict
            Why there is no result, by number of the item.

        """
        restored = {k: self.restored(kind, key) for k, key in enumerate(keys)}
        results = {k: each for k, each in restored.items() if each is not None}
        rest = [k for k in restored if k not in results]

        def keep(place: int, value: Kept) -> None:
            self.cache.put(keys[rest[place]], value.to_arrays())

        def progress(_: str, done: int, total: int) -> None:
            self.progress(stage, done, total)

        reasons = {}
        outcomes = self.engine.map(function, [items[k] for k in rest], progress, keep)
        for k, outcome in zip(rest, outcomes, strict=True):
            if outcome.value is None:
                reasons[k] = outcome.reason
            else:
                results[k] = outcome.value
        return results, reasons

    def restored(self, kind: type[Kept], key: str) -> Kept | None:
        """Return what the cache has under a key; None where it has nothing, or a damaged entry."""
        arrays = self.cache.get(key)
        try:
            return None if arrays is None else kind.from_arrays(arrays)
        except DataError:
            return None


def digest(*values: Any) -> str:
    """Return a text that changes with values of dataclasses, texts, numbers and lists of them."""
    text = json.dumps(values, sort_keys=True, default=vars)
    return hashlib.sha256(text.encode()).hexdigest()
