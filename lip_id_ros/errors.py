"""
Errors that this package raises, and texts as they are shown.

Every message is one sentence that says what was expected, what came and what to do about it, so
that the command line and the nodes can show it as it is. Errors of the file system pass through
as `OSError`.
"""

from __future__ import annotations

from collections.abc import Iterable
import difflib
import errno

MOST_SHOWN = 100  # characters of a value in a message
REMEDIES = {errno.ENOENT: '; correct the path.', errno.ENOSPC: '; free that disk.'}
"""Of errors of the file system, by their numbers."""


class LipIdError(Exception):
    """Base of every error that this package raises on purpose."""


class ConfigError(LipIdError):
    """A setting has an unknown name, a wrong type or a value out of its range."""


class SourceError(LipIdError):
    """A recording cannot be read, or holds no usable joint samples."""


class TransferError(SourceError):
    """A remote recording could not be copied; another attempt may succeed."""


class DataError(LipIdError):
    """A data set contradicts itself or does not suffice for what is asked of it."""


class ShapeError(DataError):
    """An array does not have the shape that was expected."""


class ModelError(LipIdError):
    """A model file is corrupt, foreign or does not fit the robot at hand."""


class FitError(LipIdError):
    """Fitting failed for numerical reasons, or because machines that it was done on did."""


def shortened(value: object) -> str:
    """Return a value as one line for a message; of a long or deeply nested one the beginning."""
    try:
        text = ' '.join(repr(value).split())
    except (RecursionError, ValueError):  # an integer of thousands of digits has no text
        return f'such a {type(value).__name__}'
    return text if len(text) <= MOST_SHOWN else f'{text[:MOST_SHOWN]}...'


def closest(names: Iterable[str], known: Iterable[str]) -> list[str]:
    """Return the known name that is most like each of some unknown ones, where any is."""
    known = list(known)
    found = (difflib.get_close_matches(name, known, n=1) for name in names)
    return list(dict.fromkeys(name for names in found for name in names))


def missing_joints(
    missing: Iterable[str], where: str, known: Iterable[str], kind: str = 'recording'
) -> str:
    """Return the sentence on joints that are not in a `kind` of thing, where they should be."""
    missing, known = list(missing), list(known)
    alike = closest(missing, known)
    remedy = (
        f'did you mean {", ".join(alike)}?'
        if len(alike) == len(missing)
        else f'correct the names, or give a {kind} of this arm.'
    )
    subject = 'joint' if len(missing) == 1 else 'joints'
    return (
        f'{subject} {" ".join(", ".join(missing).split())} expected in {where}, which has '
        f'{", ".join(known) or "none"}; {remedy}'
    )


def printable(text: str) -> str:
    r"""Return text for a terminal or a log: control and unassigned characters as escapes."""
    return ''.join(
        each if each.isprintable() else each.encode('unicode_escape', 'surrogatepass').decode()
        for each in text
    )


def one_line(error: Exception) -> str:
    """Return the message of an error as one line; one of the file system names the file."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        remedy = REMEDIES.get(error.errno or 0, '')
        return printable(f'{error.filename}: {error.strerror}{remedy}')
    return printable(' '.join(str(error).split()))
