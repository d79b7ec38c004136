"""The sections of a ROS parameter file that belong to a node."""

from __future__ import annotations

from collections.abc import Iterator
import os
import re
from typing import Any

from lip_id_ros.errors import ConfigError
from lip_id_ros.settings.sections import load_yaml

VALUES = 'ros__parameters'


def parameters_in_file(path: str | os.PathLike[str], node: str) -> dict[str, Any]:
    """
    Return what a parameter file has for a node, given by its full name such as /left/serve.

    ConfigError if it has no section for the node: ROS would start the node without a word.
    """
    if not os.path.isfile(path):
        raise ConfigError(
            f'params_file must be a file, there is none at {os.fspath(path)}; correct the path.'
        )
    found = dict(_sections(load_yaml(path)))
    mine = [values for name, values in found.items() if _pattern(name).fullmatch(node)]
    if not mine:
        known = ', '.join(found) or 'none'
        raise ConfigError(
            f'{os.fspath(path)} has no section for the node {node}, its sections are: {known}; '
            f'name one /**/{node.rpartition("/")[2]} and put {VALUES} beneath.'
        )
    return {name: value for values in mine for name, value in values.items()}


def _sections(content: object, outer: str = '') -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the full name and the parameters of every section, which may be nested."""
    for key, value in content.items() if isinstance(content, dict) else ():
        if key == VALUES:
            yield outer, value if isinstance(value, dict) else {}
        else:
            yield from _sections(value, f'{outer}/{str(key).strip("/")}')


def _pattern(section: str) -> re.Pattern[str]:
    """Return what a section's name matches: * stands for one part of a name, ** for any."""
    wild = {'**': '(/[^/]+)*', '*': '/[^/]+'}
    parts = section.strip('/').split('/')
    return re.compile(''.join(wild.get(part, '/' + re.escape(part)) for part in parts))
