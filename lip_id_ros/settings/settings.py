"""
Settings described once: a frozen dataclass whose fields carry description, unit and range.

The same table gives YAML files and ROS parameters their checks, defaults and documentation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import dataclasses
from dataclasses import dataclass, replace
import math
from numbers import Integral, Real
from types import MappingProxyType
from typing import Any, get_type_hints, TypeVar

from lip_id_ros.errors import closest, ConfigError, shortened

_KEY = 'lip_id_ros.setting'

# when a running node uses a new value of a parameter
AT_START = 'at the start only'
AT_ONCE = 'at once'
WHILE_EMPTY = 'at once, while no samples are kept'
NEXT_JOB = 'at the next fit or data set'
ON_CONFIGURE = 'on configure; refused while configured'
ON_LOAD = 'on configure or reload'
PER_JOINT = 'One per joint, in the order of joints, or one for all.'


def setting(
    default: Any,
    description: str,
    *,
    unit: str = '',
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    applies: str = '',
    old_name: str = '',
    old_values: Mapping[str, str] = MappingProxyType({}),
) -> Any:
    """
    Declare one field of a settings table.

    The description is one sentence for documentation and parameter descriptors; a range has its
    ends included. `choices` are the only texts allowed (for a list: in each element), or beside
    a number those in its place; `applies` is when a running node takes over a new value, where
    the table as a whole does not say so. `old_name`, and the texts of `old_values`, are refused
    with what to write in their place.
    """
    details = {
        'description': description,
        'unit': unit,
        'minimum': minimum,
        'maximum': maximum,
        'choices': choices,
        'applies': applies,
        'old_name': old_name,
        'old_values': old_values,
    }
    return dataclasses.field(default=default, metadata={_KEY: details})


def executor_setting() -> Any:
    """Declare how the callbacks of a node are run."""
    return setting(
        'events',
        'How callbacks are run. events takes less CPU at high rates; single_threaded is used '
        'where this ROS has no events executor.',
        choices=('events', 'single_threaded'),
        applies=AT_START,
    )


def description_setting() -> Any:
    """Declare the URDF that limits torques."""
    return setting(
        '',
        'URDF for torque_limits_from: robot_description; empty for that of the latched topic.',
        applies=AT_START,
    )


@dataclass(frozen=True)
class Row:
    """
    One setting as its table describes it.

    `kind` is one of bool, int, float, str, list of str, list of float.
    """

    name: str
    kind: str
    default: Any
    description: str
    unit: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]
    applies: str
    old_name: str
    old_values: Mapping[str, str]

    @property
    def _has_words(self) -> bool:
        """Whether a word may stand in place of a number."""
        return bool(self.choices) and self.kind == 'float'

    @property
    def range(self) -> str:
        """The allowed values in words, empty where any value of the kind will do."""
        limits = []
        if self.minimum is not None:
            limits.append(f'>= {self.minimum:g}')
        if self.maximum is not None:
            limits.append(f'<= {self.maximum:g}')
        return ' or '.join([*filter(None, [' and '.join(limits)]), *self.choices])

    @property
    def expected(self) -> str:
        """What a value has to be, in words for an error sentence."""
        if self._has_words:
            limits = replace(self, choices=()).expected
            return ' or '.join([limits, *self.choices])
        words = [_WORDS[self.kind], self.range, self.unit]
        return ' '.join(word for word in words if word)

    def check(self, value: object, label: str) -> Any:
        """
        Return the value in the setting's own type.

        `label` begins the sentence of a ConfigError.
        """
        if self._has_words and isinstance(value, str) and value in self.choices:
            return value
        try:
            converted = _CONVERTERS[self.kind](value)
            elements = converted if isinstance(converted, tuple) else (converted,)
            allowed = all(self._allows(element) for element in elements)
        except (TypeError, OverflowError):  # an integer beyond the floats overflows
            allowed = False
        if not allowed:
            raise self._error(value, label)
        return converted

    def _allows(self, element: Any) -> bool:
        if isinstance(element, str):
            return not self.choices or element in self.choices
        if isinstance(element, bool):
            return True
        return (
            math.isfinite(element)
            and (self.minimum is None or element >= self.minimum)
            and (self.maximum is None or element <= self.maximum)
        )

    def _error(self, value: object, label: str) -> ConfigError:
        new = self.old_values.get(str(value))
        remedy = f'; write {new}' if new else ''
        return ConfigError(f'{label} must be {self.expected}, not {shortened(value)}{remedy}.')


def rows(table: type[Settings]) -> tuple[Row, ...]:
    """Return the rows of a settings table, in the order of declaration."""
    kinds = get_type_hints(table)
    return tuple(
        Row(name=field.name, kind=_KINDS[kinds[field.name]], default=field.default, **details)
        for field in dataclasses.fields(table)
        if (details := field.metadata.get(_KEY)) is not None
    )


def parameters_of(table: type[Settings]) -> dict[str, Row]:
    """Return the rows of a settings table by name: the parameters of a node."""
    return {row.name: row for row in rows(table)}


@dataclass(frozen=True)
class Settings:
    """Base of every settings table: no instance holds a value that its `Row` would not take."""

    def __post_init__(self) -> None:
        """Check every value and bring it to its own type."""
        table = type(self)
        for row in rows(table):
            value = row.check(getattr(self, row.name), f'{table.__name__}.{row.name}')
            object.__setattr__(self, row.name, value)


Table = TypeVar('Table', bound=Settings)


def build(table: type[Table], values: Mapping[str, object], section: str, origin: str) -> Table:
    """
    Make settings from named values.

    What is not named keeps its default. `section` and `origin` are for the sentence of a
    ConfigError: a name is unknown, or a value has the wrong type or is out of range.
    """
    known = {row.name: row for row in rows(table)}
    checked = {}
    for name, value in values.items():
        if name not in known:
            raise ConfigError(unknown_name(f'{section}.{name}', name, known, origin))
        checked[name] = known[name].check(value, f'{section}.{name} in {origin}')
    return table(**checked)


def unknown_name(label: str, name: str, known: Mapping[str, object], origin: str) -> str:
    """Say that a name is unknown, with its new name or the closest known one."""
    renamed = [each for each, row in known.items() if getattr(row, 'old_name', None) == name]
    if renamed:
        return f'{label} in {origin} is called {renamed[0]} now; rename it.'
    close = closest([str(name)], known)
    remedy = f'did you mean {close[0]!r}?' if close else f'known are {", ".join(known)}.'
    return f'{label} in {origin} is not a setting; {remedy}'


def _boolean(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError
    return value


def _integer(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, Integral):  # those of numpy too
        raise TypeError
    return int(value)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError
    return float(value)


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _elements(value: object) -> Sequence[object]:
    if hasattr(value, 'tolist'):  # an array
        value = value.tolist()
    if isinstance(value, (str, bytes)) or not isinstance(value, Sequence):
        raise TypeError
    return value


def _texts(value: object) -> tuple[str, ...]:
    return tuple(_text(element) for element in _elements(value))


def _numbers(value: object) -> tuple[float, ...]:
    return tuple(_number(element) for element in _elements(value))


_KINDS: Mapping[object, str] = {
    bool: 'bool',
    int: 'int',
    float: 'float',
    float | str: 'float',
    str: 'str',
    tuple[str, ...]: 'list of str',
    tuple[float, ...]: 'list of float',
}

_WORDS: Mapping[str, str] = {
    'bool': 'true or false',
    'int': 'a whole number',
    'float': 'a number',
    'str': 'a text',
    'list of str': 'a list of texts',
    'list of float': 'a list of numbers',
}

_CONVERTERS: Mapping[str, Callable[[object], Any]] = {
    'bool': _boolean,
    'int': _integer,
    'float': _number,
    'str': _text,
    'list of str': _texts,
    'list of float': _numbers,
}
