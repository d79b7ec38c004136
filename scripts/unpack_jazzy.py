"""
unpack_jazzy.py WHEEL OUT: take ROS 2 Jazzy and its licences, and nothing else, out of the wheel.

The wheel's own OpenSSL is left out where the system has one: ROS's folder goes first on the
loader's path, and an older OpenSSL there would be forced on every other program of the shell.
"""

import ctypes
from pathlib import Path
import sys
import zipfile

BASE = 'isaacsim/exts/isaacsim.ros2.core/'
OPENSSL = ('libcrypto.so', 'libssl.so')


def system_has_openssl() -> bool:
    """Whether the loader finds the OpenSSL that the wheel would bring."""
    try:
        for name in OPENSSL:
            ctypes.CDLL(f'{name}.3')
    except OSError:
        return False
    return True


def place(name: str, left_out: tuple[str, ...]) -> Path | None:
    """Where a file of the wheel goes, relative to OUT; None: nowhere."""
    if name.startswith(f'{BASE}jazzy/'):
        path = Path(name[len(BASE) :])
        return None if path.name.startswith(left_out) else path
    if name == 'isaacsim/LICENSE.txt' or name.startswith(f'{BASE}PACKAGE-LICENSES/isaacsim'):
        return Path('licences') / Path(name).name
    return None


def main(wheel: str, out: str) -> None:
    """Unpack."""
    left_out = OPENSSL if system_has_openssl() else ()
    with zipfile.ZipFile(wheel) as archive:
        for entry in archive.infolist():
            path = None if entry.is_dir() else place(entry.filename, left_out)
            if path:
                target = Path(out) / path
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(archive.read(entry))


if __name__ == '__main__':
    main(*sys.argv[1:])
