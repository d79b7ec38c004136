"""Read sqlite3 files of rosbag2, also those of a recorder that was killed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import replace
import os
from pathlib import Path
import sqlite3
import struct
from typing import Any
from urllib.parse import quote

from lip_id_ros.recording.storage.contents import Channel, DamageError, full_type

MAGIC = b'SQLite format 3\0'

_HEAD = struct.Struct('>16xH10xI')  # page size and number of pages
_LAST_NUMBER = 2**62
_MOST_FAILURES = 1000  # of reading on, and of jumps, each twice as far as the one before
_LONGEST_VALUE = 64 * 2**20
_ROW_NUMBERS = ('rowid', '_rowid_', 'oid')


class SqliteFile:
    """
    A rosbag2 database, see `contents.Storage`; DamageError if it has not even a list of topics.

    Rows are read in the order of their numbers, without any index, and those that cannot be read
    are jumped over. A write-ahead log beside the file is read too; nothing is changed in either.
    """

    def __init__(self, path: Path) -> None:
        self.notes: dict[str, None] = {}
        self.lost: Counter[str] = Counter()
        with open(path, 'rb') as stream:
            head, size = stream.read(_HEAD.size), os.fstat(stream.fileno()).st_size
        if not head.startswith(MAGIC) or len(head) < _HEAD.size:
            raise DamageError('it does not begin as an sqlite3 file does')
        page_size, pages = _HEAD.unpack(head)
        if (page_size if page_size > 1 else 65536) * pages > size:
            self.notes['the file was cut short: it is smaller than its head claims'] = None
        if _is_not_empty(Path(f'{path}-journal')):
            self.notes[f'{path.name}-journal is left of a write that was never finished'] = None
        self._database = self._connected(path)
        try:
            self._row = self._checked_tables()
            self._topics = self._read_topics()
            self._counts = self._count()
        except sqlite3.Error as error:
            self.close()
            raise DamageError(str(error)) from error
        except BaseException:
            self.close()
            raise

    @property
    def channels(self) -> list[Channel]:
        """What the file holds."""
        return [replace(each, count=self._counts[each.id]) for each in self._topics]

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def messages(self, ids: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield topic, receive time [ns] and bytes of messages of some topics, by row number."""
        found: Counter[int] = Counter()
        names = {each.id: each.topic for each in self._topics}
        for topic in set(ids):
            self.lost.pop(names[topic], None)
        marks = ','.join('?' * len(ids))
        query = (
            f'SELECT {self._row}, topic_id, timestamp, data FROM messages NOT INDEXED '
            f'WHERE {self._row} > ? AND topic_id IN ({marks}) ORDER BY {self._row} LIMIT ?'
        )
        for _, topic, time_ns, data in self._rows(query, tuple(ids)):
            if isinstance(time_ns, int) and isinstance(data, bytes):
                found[topic] += 1
                yield topic, time_ns, data
        for topic in set(ids):
            missing = self._counts[topic] - found[topic]
            if missing > 0:
                self.lost[names[topic]] += missing

    def _connected(self, path: Path) -> sqlite3.Connection:
        address = f'file:{quote(str(path.resolve()))}'
        log = Path(f'{path}-wal')
        if _is_not_empty(log):
            try:
                return _opened(f'{address}?mode=ro')
            except sqlite3.Error as error:
                self.notes[f'{log.name} cannot be read ({error}): what it holds is lost'] = None
        try:  # without a log the file is read alone, and nothing is made beside it
            return _opened(f'{address}?immutable=1')
        except sqlite3.Error as error:
            raise DamageError(str(error)) from error

    def _checked_tables(self) -> str:
        """Return the name of the row number; DamageError where a table is none."""
        rows = self._database.execute(
            'SELECT name, type, sql FROM sqlite_master '
            "WHERE name IN ('messages', 'topics', 'message_definitions')"
        )
        for name, kind, sql in rows:
            if kind != 'table' or 'virtual' in str(sql).lower().split()[:2]:
                raise DamageError(f'its {str(name)!r} is no table')
        columns = {
            str(row[1]).lower() for row in self._database.execute('PRAGMA table_info(messages)')
        }
        free = [name for name in _ROW_NUMBERS if name not in columns]
        if not free:
            raise DamageError('its columns have the names of the row number')
        return free[0]

    def _read_topics(self) -> list[Channel]:
        definitions: dict[str, str] = {}
        with suppress(sqlite3.Error):  # older schemas have none
            rows = self._database.execute(
                'SELECT topic_type, encoded_message_definition FROM message_definitions'
            )
            definitions = {str(name): str(text) for name, text in rows}
        rows = self._database.execute('SELECT id, name, type, serialization_format FROM topics')
        return [
            Channel(
                number, str(name), full_type(str(kind)), str(form), definitions.get(kind, ''), 0
            )
            for number, name, kind, form in rows
            if isinstance(number, int)
        ]

    def _count(self) -> Counter[int]:
        try:
            rows = self._database.execute(
                'SELECT topic_id, count(*) FROM messages NOT INDEXED GROUP BY topic_id'
            ).fetchall()
            return Counter({topic: count for topic, count in rows if isinstance(topic, int)})
        except sqlite3.DatabaseError:
            query = (
                f'SELECT {self._row}, topic_id FROM messages NOT INDEXED '
                f'WHERE {self._row} > ? ORDER BY {self._row} LIMIT ?'
            )
            return Counter(topic for _, topic in self._rows(query, ()) if isinstance(topic, int))

    def _rows(self, query: str, values: tuple[int, ...]) -> Iterator[tuple[Any, ...]]:
        """
        Yield rows by number; `query` begins after a number and has a limit.

        The library reads one row ahead, so that damage takes the row before it along: after a
        failure the next row is asked for alone, and jumped over only if that fails too.
        """
        last, jump, failures, limit = -(2**63), 1, 0, -1
        while failures < _MOST_FAILURES and last < _LAST_NUMBER:
            before = last
            try:
                for row in self._database.execute(query, (last, *values, limit)):
                    if row[0] > last:  # always, unless the file's tree leads in a circle
                        last = row[0]
                        yield row
                if limit < 0 or last == before:
                    return
                limit, jump = -1, 1
            except sqlite3.DatabaseError as error:
                self.notes[f'rows cannot be read ({error})'] = None
                failures += 1
                if limit < 0:
                    limit = 1
                else:
                    last, jump = max(last, 0) + jump, 2 * jump


def _is_not_empty(path: Path) -> bool:
    return path.exists() and path.stat().st_size > 0


def _opened(address: str) -> sqlite3.Connection:
    database = sqlite3.connect(address, uri=True, check_same_thread=False)
    try:
        # what is shorter than its head claims is read as far as it goes
        database.execute('PRAGMA writable_schema=ON')
        database.text_factory = lambda data: data.decode(errors='replace')
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST_VALUE)
        database.execute('SELECT count(*) FROM sqlite_master').fetchone()
    except BaseException:
        database.close()
        raise
    return database
