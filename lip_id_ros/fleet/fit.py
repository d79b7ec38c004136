"""A fit to a fleet of recordings: survey, placements, statistics, sum, solution."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, Protocol, TypeVar

from lip_id_ros.fleet.results import FleetResult
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import Config

Item = TypeVar('Item', contravariant=True)
Result = TypeVar('Result')


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


class Outcome(Protocol):
    """What came of one item: a value, or the reason why there is none."""

    @property
    def value(self) -> Any:
        """Result of the function; None where it failed."""

    @property
    def reason(self) -> str:
        """Why it failed; empty where it did not."""


class Engine(Protocol):
    """Runs a function for each of many items."""

    def map(
        self, function: Callable[[Any], Any], items: Sequence[Any], progress: Progress
    ) -> Sequence[Outcome]:
        """Return the outcomes in the order of the items."""


class Cache(Protocol):
    """Keeps named arrays under a key."""

    def get(self, key: str) -> Mapping[str, Any] | None:
        """Return the arrays of a key; None where there are none."""

    def put(self, key: str, arrays: Mapping[str, Any]) -> None:
        """Keep arrays; whole or not at all."""


def fit_fleet(
    sources: Sequence[Source],
    config: Config,
    engine: Engine,
    cache: Cache | None = None,
    progress: Progress = silent,
) -> FleetResult:
    """
    Fit one model to all recordings of a fleet.

    Parameters
    ----------
    sources : sequence of Source
    config : Config
    engine : Engine
    cache : Cache, optional
        Of surveys and statistics, by the sources' fingerprints, the settings and the placements.
    progress : callable

    Raises
    ------
    DataError
        If no recording can be used.

    """
    raise NotImplementedError
