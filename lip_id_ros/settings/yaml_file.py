"""Settings in YAML files: read with strict checks, written with their documentation."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
import json
import os
import re
import textwrap
from typing import Any

import yaml

from lip_id_ros.errors import ConfigError
from lip_id_ros.settings.sections import override_sections, sections
from lip_id_ros.settings.settings import Row, rows
from lip_id_ros.settings.tables import Config


def read_config(path: str | os.PathLike[str]) -> Config:
    """
    Read settings from a YAML file; what it does not name keeps its default.

    Parameters
    ----------
    path : path
        A YAML file with the sections of `Config`.

    Raises
    ------
    ConfigError
        If it is not YAML, or a section, name or value is not allowed; names file and key.
    OSError
        If the file cannot be read.

    """
    origin = os.fspath(path)
    content = _load(path)
    if content is None:
        return Config()
    nested = {
        section: _mapping(values, origin, f'settings under {section!r}')
        for section, values in _mapping(content, origin, 'sections').items()
    }
    return override_sections(Config(), nested, origin)


def example_yaml(config: Any) -> str:
    """Return a YAML file of settings, each with its description, unit and range."""
    blocks = ['# Settings of a fit; leave out what you do not change.']
    for section, settings in sections(config).items():
        lines = [f'# {(type(settings).__doc__ or "").strip()}', f'{section}:']
        for row in rows(type(settings)):
            lines += _documented(row, getattr(settings, row.name))
        blocks.append('\n'.join(lines))
    return '\n\n'.join(blocks) + '\n'


def _documented(row: Row, value: object) -> Iterator[str]:
    details = ', '.join(part for part in (row.unit, row.range) if part)
    comment = f'{row.description} [{details}]' if details else row.description
    for line in textwrap.wrap(comment, 94):
        yield f'  # {line}'
    yield f'  {row.name}: {json.dumps(value)}'


def _mapping(content: object, origin: str, what: str) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise ConfigError(f'{origin} must hold {what} as "name: value", not {content!r}.')
    return content


def _load(path: str | os.PathLike[str]) -> object:
    with open(path, 'rb') as file:
        try:
            return yaml.load(file, _StrictLoader)
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            reason = ' '.join(str(error).split())
            raise ConfigError(
                f'{os.fspath(path)} is not YAML that can be read ({reason}); correct it there.'
            ) from error


class _StrictLoader(yaml.SafeLoader):
    """Safe loader that refuses repeated keys and takes 1e-3 for a number, as YAML 1.2 does."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        names = [self.construct_object(key, deep=True) for key, _ in node.value]
        for name in names:
            if names.count(name) > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f'{name!r} comes twice', node.start_mark
                )
        mapping: dict[Hashable, Any] = super().construct_mapping(node, deep)
        return mapping


_StrictLoader.add_implicit_resolver(
    'tag:yaml.org,2002:float',
    re.compile(r'[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$'),
    list('-+0123456789'),
)
