"""Programs with the loop of a controller manager and something beside or beneath it."""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
import subprocess

PROGRAMS = Path(__file__).resolve().parents[1] / 'scripts' / 'jazzy_programs'
LIBRARIES = ('controller_manager', 'rclcpp', 'rcutils')


def compiled(source: Path, folder: Path, libraries: Sequence[str] = ()) -> str:
    """Compile a source that includes ros2_control_node.cpp and headers of a folder."""
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    places = [Path(prefix) / 'lib' for prefix in prefixes]
    place = next(each for each in places if (each / 'libcontroller_manager.so').is_file())
    program = folder / source.stem
    command: list[str | Path] = ['g++', '-std=c++17', '-O2', '-w', '-pthread', '-rdynamic']
    command += ['-o', program, source, '-I', folder, '-I', PROGRAMS]
    command += [place / f'lib{name}.so' for name in (*LIBRARIES, *libraries)]
    subprocess.run([*command, f'-Wl,-rpath,{place}', '-Wl,--allow-shlib-undefined'], check=True)
    return str(program)
