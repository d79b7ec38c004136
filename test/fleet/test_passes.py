"""A pass takes from the cache what is known, refusals included."""

from __future__ import annotations

from dataclasses import dataclass

from fleet.fleets import PlainEngine
import pytest

from lip_id_ros.checked_file import Packable
from lip_id_ros.errors import DataError, TransferError
from lip_id_ros.fleet.passes import digest, Passes
from lip_id_ros.progress import silent


@dataclass(frozen=True, eq=False)
class Square(Packable):
    KIND = 'square'
    value: int


ERRORS = {
    -1: DataError('the bag is empty.'),
    -2: TransferError('the connection broke.'),
    -3: PermissionError('not for you'),
    -4: ZeroDivisionError('of a library'),
}


def square(number: int) -> Square:
    if number < 0:
        raise ERRORS[number]
    return Square(number**2)


def run(items: list[int], engine: PlainEngine, cache: dict[str, bytes]) -> tuple[object, object]:
    passes = Passes(engine, cache, silent)
    results, reasons = passes.run(Square, square, items, [digest(k) for k in items], 'squares')
    return {k: each.value for k, each in results.items()}, reasons


def test_refusals_are_kept_and_other_failures_are_tried_again() -> None:
    engine, cache = PlainEngine(), dict[str, bytes]()
    items = [3, -1, -2, -3, -4, 4]
    first = run(items, engine, cache)
    assert first[0] == {0: 9, 5: 16}
    assert first[1] == {
        1: 'the bag is empty.',
        2: 'the connection broke.',
        3: 'not for you',
        4: 'ZeroDivisionError: of a library',
    }
    assert run(items, engine, cache) == first
    assert engine.counts == [6, 3]
    assert sorted(key.split('.')[1] for key in cache) == ['refusal', 'square', 'square']


@pytest.mark.parametrize(
    'content', [b'', b'[]', b'[{}, {}]\n', b'[{"value": 3, "more": 1}, {}]\n']
)
def test_what_cannot_be_read_is_made_anew(content: bytes) -> None:
    engine = PlainEngine()
    assert run([3], engine, {f'{digest(3)}.square': content}) == ({0: 9}, {})
    assert engine.counts == [1]
