"""A local object-store server, and copies of folders in stores."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
import uuid

import fsspec
import pytest


@contextmanager
def object_store() -> Iterator[str]:
    """Run a server of Google's protocol; give the URL of an empty bucket."""
    name = uuid.uuid4().hex
    with pytest.MonkeyPatch.context() as patch:
        # else gcsfs asks over gRPC, when it is imported, what the server does not answer
        patch.setenv('GCSFS_EXPERIMENTAL_ZB_HNS_SUPPORT', 'false')
        pytest.importorskip('gcsfs', reason='gcsfs is not installed')
        server = pytest.importorskip('gcp_storage_emulator.server', reason='no object store')
        running: Any = server.create_server('localhost', 0, in_memory=True, default_bucket=name)
        running.start()
        port = running._api._httpd.server_address[1]
        patch.setenv('STORAGE_EMULATOR_HOST', f'http://localhost:{port}')
        patch.setenv('FSSPEC_GS', '{"token": "anon"}')  # for processes started meanwhile
        patch.setitem(fsspec.config.conf, 'gs', {'token': 'anon'})
        yield f'gs://{name}'
        running.stop()


def upload(folder: Path, url: str) -> None:
    """Copy a folder into a store."""
    system, root = fsspec.core.url_to_fs(url)
    for path in folder.rglob('*'):
        if path.is_file():
            system.pipe_file(f'{root}/{path.relative_to(folder)}', path.read_bytes())
