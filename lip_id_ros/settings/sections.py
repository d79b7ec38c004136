"""Settings tables gathered under section names, addressed as ``section.name``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import dataclasses
from typing import Any, TypeVar

from lip_id_ros.errors import ConfigError
from lip_id_ros.settings.settings import build, Row, rows, Settings, unknown_name

Sections = TypeVar('Sections')


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
    Return settings with some of them replaced.

    Parameters
    ----------
    config : dataclass of settings tables
        Such as `Config`.
    values : mapping
        New values by ``section.name``.
    origin : str
        Where they came from, for error sentences.

    Raises
    ------
    ConfigError
        If a name is unknown, or a value has the wrong type or is out of range.

    """
    nested: dict[str, dict[str, object]] = {}
    for key, value in values.items():
        section, _, name = key.partition('.')
        nested.setdefault(section, {})[name] = value
    return override_sections(config, nested, origin)


def override_sections(
    config: Sections, values: Mapping[str, Mapping[str, object]], origin: str
) -> Sections:
    """
    Return settings with some of them replaced, given by section and name.

    Raises
    ------
    ConfigError
        If a section or name is unknown, or a value has the wrong type or is out of range.

    """
    tables = sections(config)
    changed = {}
    for section, some in values.items():
        if section not in tables:
            raise ConfigError(unknown_name(section, section, tables, origin))
        kept = vars(tables[section])
        changed[section] = build(type(tables[section]), {**kept, **some}, section, origin)
    return dataclasses.replace(config, **changed)  # type: ignore[type-var]
