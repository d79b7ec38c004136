"""ROS domains that tests on one machine do not share, whatever runs beside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import fcntl
import itertools
import os
from pathlib import Path
import tempfile


@contextmanager
def free_domain() -> Iterator[int]:
    """Give a ROS domain that no other test on this machine uses while the block runs."""
    folder = Path(tempfile.gettempdir()) / f'lip_id_ros_domains_{os.getuid()}'
    folder.mkdir(exist_ok=True)
    for number in itertools.cycle(range(1, 101)):  # beyond 101 ports may be taken
        with open(folder / str(number), 'w') as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield number
            return
