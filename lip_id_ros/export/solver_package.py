"""An identified arm as a ROS 2 package in C++: a plugin of inverse_dynamics_solver."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
import os
from pathlib import Path
import re
from string import Template

from lip_id_ros.errors import ConfigError, printable
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.files import write_whole

MARK = b'identified by lip_id_ros'
SUFFIX = '_inverse_dynamics_solver'
LONGEST_NAME = 200
"""Of an arm: names of files have 255 bytes at most, and those of the package are longer."""


class _Text(Template):
    delimiter = '%'  # CMake has the dollar


def package_name(name: str) -> str:
    """Return the name of the package of an arm: lower case, as ROS wants it."""
    return re.sub('_+', '_', name.lower()).strip('_') + SUFFIX


def solver_package(arm: ArmDescription, header: str) -> Mapping[str, str]:
    """
    Return the files of the package by their paths in it; `header`: the arm in C.

    ConfigError if the name of the arm is too long for names of files.

    """
    if len(arm.name) > LONGEST_NAME:
        raise ConfigError(
            f'the name of an arm must have {LONGEST_NAME} letters at most in a package, not '
            f'{len(arm.name)}; give a shorter --name.'
        )
    package, folder = package_name(arm.name), resources.files(__package__)
    joints = [f'//   {n}: {printable(name)}' for n, name in enumerate(arm.joint_names)]
    values = {
        'name': arm.name,
        'package': package,
        'n': arm.n_joints,
        'joints': '\n'.join(line.replace('\\', '/') for line in joints),
    }

    def filled(template: str) -> str:
        return _Text((folder / template).read_text(encoding='utf-8')).substitute(values)

    return {
        'package.xml': filled('solver.package.in'),
        'CMakeLists.txt': filled('solver.cmake.in'),
        f'{package}.xml': filled('solver.plugin.in'),
        f'src/{package}.cpp': filled('solver.cpp.in'),
        f'include/{package}/{arm.name}_dynamics.h': header,
    }


def require_own(folder: str, force: bool) -> None:
    """Refuse a folder that holds something else; ConfigError unless `force`."""
    place = Path(folder)
    if not place.exists() or force:
        return
    manifest = place / 'package.xml'
    is_own = manifest.is_file() and MARK in manifest.read_bytes()
    if not place.is_dir() or (any(place.iterdir()) and not is_own):
        raise ConfigError(
            f'{folder} exists and is not a package of a solver; name another folder, or give '
            '--force to write into it.'
        )


def save(files: Mapping[str, str], folder: str | os.PathLike[str]) -> None:
    """
    Write the files of a package into a folder, which is made; OSError if that fails.

    Those that another name of the arm left there are removed, since CMake would install them.

    """
    for pattern in ('*{}.xml', 'src/*{}.cpp', 'include/*{}/*_dynamics.h'):
        for old in Path(folder).glob(pattern.format(SUFFIX)):
            if str(old.relative_to(folder)) not in files and MARK in old.read_bytes():
                old.unlink()
    for name, text in files.items():
        path = Path(folder) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text.encode())
