"""What is found in a recording, and the checks that find it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import NamedTuple

from lip_id_ros.health.evidence import Evidence


class Severity(StrEnum):
    """How much a finding matters, most first."""

    ERROR = 'error'  # nothing can be learned
    WARNING = 'warning'  # what is learned will be worse, or wrong
    NOTE = 'note'  # good to know


@dataclass(frozen=True)
class Finding:
    """
    One thing that is wrong with a recording.

    Attributes
    ----------
    code : str
        Stable name of its kind, see docs/health.md.
    severity : str
    joint : str
        Empty where it is about the whole recording.
    text : str
        One sentence: what was found, and what to do.

    """

    code: str
    severity: str
    joint: str
    text: str

    def to_json(self) -> dict[str, str]:
        """Return the fields as JSON knows them."""
        return asdict(self)


class Found(NamedTuple):
    """What a check found: a joint, or '' for the whole recording, and what is wrong with it."""

    joint: str
    what: str


@dataclass(frozen=True)
class Check:
    """
    One kind of finding.

    Attributes
    ----------
    code : str
        Stable name.
    severity : Severity
    meaning : str
        When it is found, for the documentation.
    remedy : str
        What to do, as the end of a sentence.
    search : callable
        Yields what is found.

    """

    code: str
    severity: Severity
    meaning: str
    remedy: str
    search: Callable[[Evidence], Iterable[Found]]

    def findings(self, evidence: Evidence) -> list[Finding]:
        """Return one finding for everything that the search finds."""
        return [
            Finding(self.code, self.severity.value, found.joint, f'{found.what}; {self.remedy}.')
            for found in self.search(evidence)
        ]
