"""Small programs of C++ with the libraries of the ROS in use, which tests run."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import subprocess

import pytest


def built(source: Path, folder: Path, *names: str) -> Path:
    """
    Compile a program and link libraries of ROS, whose headers need not be there.

    The test is skipped where there is no compiler, or one of the libraries is missing.

    """
    if shutil.which('g++') is None:
        pytest.skip('needs g++')
    libraries = [_library(name) for name in names]
    program = folder / source.stem
    paths = [f'-Wl,-rpath,{library.parent}' for library in libraries]
    files = [str(path) for path in (program, source, *libraries)]
    command = ['g++', '-o', *files, *paths, '-Wl,--allow-shlib-undefined']
    subprocess.run(command, check=True)
    return program


def _library(name: str) -> Path:
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    # Ubuntu has some of them as packages of its own
    folders = [*(Path(x) / 'lib' for x in prefixes), *Path('/usr/lib').glob('*-linux-gnu')]
    found = (file for folder in folders for file in folder.glob(f'**/lib{name}.so*'))
    library = next(found, None)
    if library is None:
        pytest.skip(f'needs lib{name} of ROS')
    return library
