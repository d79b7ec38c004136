"""Findings, and the checks that search for them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from enum import StrEnum

from lip_id_ros.health.evidence import Evidence, Joint


class Severity(StrEnum):
    """How much a finding matters, most first."""

    ERROR = 'error'  # nothing can be learned
    WARNING = 'warning'  # what is learned will be worse, or wrong
    NOTE = 'note'  # good to know


@dataclass(frozen=True)
class Finding:
    """
    One thing that is wrong with a recording.

    `code`: stable name of its kind, see health.md. `joint`: empty where it is about the whole
    recording. `text`: one sentence: what was found, and what to do.
    """

    code: str
    severity: str
    joint: str
    text: str

    def to_json(self) -> dict[str, str]:
        """Return the fields as JSON knows them."""
        return asdict(self)


JointText = tuple[str, str]
"""Name of a joint, empty for the whole recording, and what is wrong with it."""

Search = Callable[[Evidence], Iterable[JointText]]
JointSearch = Callable[[Joint], Iterable[str]]


@dataclass(frozen=True)
class Check:
    """
    One kind of finding; made by the decorators `check` and `joint_check`.

    `meaning`: when it is found, for health.md: the docstring of `search`, which yields what is
    found. `remedy`: what to do, as the end of a sentence.
    """

    code: str
    severity: Severity
    meaning: str
    remedy: str
    search: Search

    def findings(self, evidence: Evidence) -> list[Finding]:
        """Return one finding for everything that the search finds."""
        return [
            Finding(self.code, self.severity.value, joint, f'{what}; {self.remedy}.')
            for joint, what in self.search(evidence)
        ]


def check(code: str, severity: Severity, remedy: str) -> Callable[[Search], Check]:
    """Make a check of a search through a recording; see `Check` for the parameters."""

    def of(search: Search) -> Check:
        return Check(code, severity, ' '.join((search.__doc__ or '').split()), remedy, search)

    return of


def joint_check(code: str, severity: Severity, remedy: str) -> Callable[[JointSearch], Check]:
    """Make a check of a search that yields what is wrong with one joint."""

    def of(search: JointSearch) -> Check:
        def all_joints(evidence: Evidence) -> Iterator[JointText]:
            return ((each.name, text) for each in evidence.joints for text in search(each))

        all_joints.__doc__ = search.__doc__
        return check(code, severity, remedy)(all_joints)

    return of
