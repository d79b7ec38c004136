"""Settings tables in sections, addressed as ``section.name``, and their YAML files."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
import dataclasses
import json
import os
import re
import textwrap
from typing import Any, TypeVar

import yaml

from lip_id_ros.errors import ConfigError, shortened
from lip_id_ros.files import path_text, require_regular_file
from lip_id_ros.settings.settings import build, Row, rows, Settings, unknown_name
from lip_id_ros.settings.tables import Config

Sections = TypeVar('Sections')

MOST_BYTES = 1_000_000  # of a YAML file
BAD_YAML = (yaml.YAMLError, RecursionError, ValueError)
"""
Errors of the YAML parser: it lets those of int() and datetime() through, and Unicode errors are
ValueError too.
"""


def sections(config: Any) -> dict[str, Settings]:
    """Return the settings tables of a gathering such as `Config`, by section name."""
    return {field.name: getattr(config, field.name) for field in dataclasses.fields(config)}


def flat_rows(config: Any) -> Iterator[tuple[str, Row]]:
    """Yield ``section.name`` and row of every setting: ROS parameters, documentation."""
    for section, settings in sections(config).items():
        for row in rows(type(settings)):
            yield f'{section}.{row.name}', row


def flatten(config: Any) -> dict[str, Any]:
    """Return the value of every setting under ``section.name``."""
    tables = sections(config)
    return {
        f'{section}.{row.name}': getattr(tables[section], row.name)
        for section in tables
        for row in rows(type(tables[section]))
    }


def override(config: Sections, values: Mapping[str, object], origin: str) -> Sections:
    """
    Return settings with the values of ``section.name`` replaced.

    `origin` is for error sentences. ConfigError if a name is unknown, or a value has the wrong
    type or is out of range.
    """
    nested: dict[str, dict[str, object]] = {}
    for key, value in values.items():
        section, _, name = key.partition('.')
        nested.setdefault(section, {})[name] = value
    return override_sections(config, nested, origin)


def override_sections(
    config: Sections, values: Mapping[str, Mapping[str, object]], origin: str
) -> Sections:
    """Return settings with some replaced, by section and name; raises what `override` raises."""
    tables = sections(config)
    changed = {}
    for section, some in values.items():
        if section not in tables:
            raise ConfigError(unknown_name(section, section, tables, origin))
        kept = vars(tables[section])
        changed[section] = build(type(tables[section]), {**kept, **some}, section, origin)
    return dataclasses.replace(config, **changed)  # type: ignore[type-var]


def read_config(path: str | os.PathLike[str]) -> Config:
    """
    Read settings from a YAML file; settings that it does not name keep their defaults.

    Raises
    ------
    ConfigError
        If it is not YAML, or a section, name or value is not allowed; names file and key.
    SourceError
        If it is not a regular file.
    OSError
        If the file cannot be read.

    """
    return read_sections(path, Config())


def read_sections(path: str | os.PathLike[str], defaults: Sections) -> Sections:
    """Read settings of any gathering as `read_config` does, with the same errors."""
    origin = path_text(path)
    content = load_yaml(path)
    if content is None:
        return defaults
    nested = {
        section: _mapping(values, origin, f'settings under {section!r}')
        for section, values in _mapping(content, origin, 'sections').items()
    }
    return override_sections(defaults, nested, origin)


def example_yaml(config: Any, what: str = 'a fit') -> str:
    """Return a YAML file of settings, each with its description, unit and range."""
    blocks = [f'# Settings of {what}; leave out what you do not change.']
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
        raise ConfigError(f'{origin} must hold {what} as "name: value", not {shortened(content)}.')
    return content


def load_yaml(path: str | os.PathLike[str]) -> object:
    """Return the content of a YAML file; ConfigError if it is none."""
    require_regular_file(path)
    with open(path, 'rb') as file:
        text = file.read(MOST_BYTES + 1)
    if len(text) > MOST_BYTES:
        raise ConfigError(
            f'{os.fspath(path)} must be a file of settings, but has more than {MOST_BYTES} bytes; '
            'name another file.'
        )
    try:
        return yaml.load(text, _StrictLoader)
    except BAD_YAML as error:
        reason = ' '.join(str(error).split())
        raise ConfigError(
            f'{os.fspath(path)} is not readable YAML ({reason}); correct it there.'
        ) from error


class _StrictLoader(yaml.SafeLoader):
    """
    Safe loader that refuses repeated keys and aliases, and reads 1e-3 as a number like YAML 1.2.

    Settings need no aliases, and nested ones expand without bound.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.events.AliasEvent):
            raise yaml.composer.ComposerError(None, None, 'an alias')
        return super().compose_node(parent, index)

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
