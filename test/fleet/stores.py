"""A local object-store server, and copies of folders in stores."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import json
import logging
from pathlib import Path
from typing import Any
import uuid

import fsspec
import pytest


@contextmanager
def object_store() -> Iterator[str]:
    """Run a server of the S3 protocol; give the URL of an empty bucket."""
    pytest.importorskip('s3fs', reason='s3fs is not installed')
    server = pytest.importorskip('moto.server', reason='no S3 server is installed')
    logging.getLogger('werkzeug').setLevel(logging.ERROR)  # a line for each request
    running: Any = server.ThreadedMotoServer('127.0.0.1', port=0, verbose=False)
    running.start()
    host, port = running.get_host_and_port()
    options = {'endpoint_url': f'http://{host}:{port}', 'key': 'key', 'secret': 'secret'}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('FSSPEC_S3', json.dumps(options))  # for processes started meanwhile
        patch.setitem(fsspec.config.conf, 's3', options)
        name = uuid.uuid4().hex
        fsspec.filesystem('s3').mkdir(name)
        yield f's3://{name}'
        running.stop()


def upload(folder: Path, url: str) -> None:
    system, root = fsspec.core.url_to_fs(url)
    for path in folder.rglob('*'):
        if path.is_file():
            system.pipe_file(f'{root}/{path.relative_to(folder)}', path.read_bytes())
