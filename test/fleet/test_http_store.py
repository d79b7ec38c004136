"""Recordings of an HTTP server: replaced, cut short, behind credentials."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
import resource
from threading import Thread
from typing import Any

import pytest

from lip_id_ros.errors import SourceError, TransferError
from lip_id_ros.fleet.engines import attempt
from lip_id_ros.fleet.sources import find, StoredRecording
from lip_id_ros.fleet.stored_files import fetch, public, StoredFile

pytest.importorskip('aiohttp', reason='fsspec opens http:// with aiohttp, which is not installed')

SECRET = '?X-Signature=s3cr3t'


@dataclass
class Server:
    """
    Serves one file, without ranges and ETag.

    `ends` is how many bytes of the file are sent before the connection ends, one entry per answer;
    `modified` is a header that may be empty.

    """

    content: bytes = b'first'
    modified: str = ''
    ends: list[int] = field(default_factory=list)
    query: str = ''
    url: str = ''

    def handler(server) -> type[BaseHTTPRequestHandler]:  # noqa: N805
        class Handler(BaseHTTPRequestHandler):
            def do_HEAD(self) -> None:
                if server.query not in self.path:
                    self.send_error(404)
                    return
                self._answer(server.content, has_size=True)

            def do_GET(self) -> None:
                if server.query not in self.path:
                    self.send_error(404)
                    return
                end = server.ends.pop(0) if server.ends else len(server.content)
                self._answer(server.content, has_size=False)
                self.wfile.write(server.content[:end])

            def _answer(self, content: bytes, *, has_size: bool) -> None:
                self.send_response(200)
                self.send_header('Accept-Ranges', 'none')
                if server.modified:
                    self.send_header('Last-Modified', server.modified)
                if has_size:
                    self.send_header('Content-Length', str(len(content)))
                self.end_headers()

            def log_message(self, *values: object) -> None:
                """Say nothing."""

        return Handler


@contextmanager
def serving(server: Server) -> Iterator[Server]:
    running = ThreadingHTTPServer(('127.0.0.1', 0), server.handler())
    thread = Thread(target=running.serve_forever)
    thread.start()
    server.url = f'http://127.0.0.1:{running.server_port}/run.mcap'
    try:
        yield server
    finally:
        running.shutdown()
        thread.join()
        running.server_close()


@pytest.fixture
def server() -> Iterator[Server]:
    with serving(Server()) as one:
        yield one


def found(url: str) -> StoredRecording:
    (one,) = find([url])
    return one


def read(recording: StoredRecording) -> bytes:
    with recording.local() as path:
        return Path(path).read_bytes()


def copied(file: StoredFile, target: Path, sleep: Any = lambda seconds: None) -> bytes:
    fetch(file, target, sleep)
    return target.read_bytes()


def test_a_full_disk_is_named(server: Server, tmp_path: Path) -> None:
    server.content = bytes(5000)
    (file,) = found(server.url).files
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    waits: list[float] = []
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
    try:
        with pytest.raises(TransferError, match=r'to .* \(File too large\); free some of that'):
            copied(file, tmp_path / 'copy', waits.append)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert waits == []


def test_credentials_are_used_and_not_shown(server: Server) -> None:
    server.query = SECRET
    signed = found(server.url + SECRET)
    assert signed.name == server.url
    assert read(signed) == b'first'
    (file,) = signed.files
    server.query = 'of another'
    gone = attempt(read, signed)
    assert server.url in gone.reason
    assert SECRET not in gone.reason
    with pytest.raises(SourceError) as refused:
        find([server.url.replace('run.mcap', 'notes.txt') + SECRET])
    assert SECRET not in str(refused.value)
    assert SECRET in file.url


@pytest.mark.parametrize(
    ('url', 'shown'),
    [
        ('https://me:pass@lab.org/a/b.mcap?key=1', 'https://lab.org/a/b.mcap'),
        ('ftp://me:pass@lab.org/a@b/c?.mcap', 'ftp://lab.org/a@b/c?.mcap'),
        ('abfs://bags@account.net/a', 'abfs://bags@account.net/a'),
        ('s3://bucket/[ab]?/**', 's3://bucket/[ab]?/**'),
        ('a?/b@c:d', 'a?/b@c:d'),
    ],
)
def test_addresses_are_shown_without_credentials(url: str, shown: str) -> None:
    assert public(url) == shown
