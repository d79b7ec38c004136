"""Which code made a result: the version of the package, and a digest of what fits and judges."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
import hashlib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
PARTS = (
    *('baselines', 'gp', 'kernels', 'linear_algebra.py', 'model', 'serving'),
    *('comparison/cell.py', 'evaluation/metrics.py'),
)
UNKNOWN = 'unknown'


@cache
def code_version() -> str:
    """Return a text that is another one where a source of `PARTS` is."""
    try:
        known = version(PACKAGE.name)
    except PackageNotFoundError:  # sources on the path, not installed
        known = UNKNOWN
    return f'{known}-{source_digest(PACKAGE / part for part in PARTS)}'


def source_digest(places: Iterable[Path]) -> str:
    """Return eight digits that the Python sources below some folders, or files, lead to."""
    digest = hashlib.sha256()
    for place in places:
        for path in [place] if place.is_file() else sorted(place.rglob('*.py')):
            digest.update(path.relative_to(place.parent).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:8]


def made_by_others(codes: Iterable[str], here: str) -> list[str]:
    """Say so where results were made by other code than that of the version `here`."""
    all_codes = list(codes)
    others = sorted({code for code in all_codes if code != here})
    if not others:
        return []
    count = sum(code != here for code in all_codes)
    return [
        f'{count} of {len(all_codes)} results were kept from other code ({", ".join(others)}; '
        f'this is {here}); for results of this code compare into a new folder.'
    ]
