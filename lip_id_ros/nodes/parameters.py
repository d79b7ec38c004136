"""ROS parameters made from the settings tables: declared, described, checked when they are set."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from lip_id_ros.errors import ConfigError
from lip_id_ros.settings import Row
from lip_id_ros.settings.settings import AT_START, unknown_name

_LARGEST_INTEGER = 2**63 - 1

TYPES = {
    'bool': Parameter.Type.BOOL,
    'int': Parameter.Type.INTEGER,
    'float': Parameter.Type.DOUBLE,
    'str': Parameter.Type.STRING,
    'list of str': Parameter.Type.STRING_ARRAY,
    'list of float': Parameter.Type.DOUBLE_ARRAY,
}
"""The type of a parameter by the kind of its row."""


def declare(node: Node, table: Mapping[str, Row]) -> None:
    """
    Declare every row of a table; from here on a wrong value is refused with a sentence.

    InvalidParameterValueException if a value from a file or the command line is not allowed;
    ConfigError for a name that is not in the table: a misspelt limit would stay at its default.
    """
    node.add_on_set_parameters_callback(lambda changed: _check(table, changed))
    node.add_pre_set_parameters_callback(
        lambda changed: (
            [_typed(table[each.name], each) for each in changed if each.name in table]
            + [each for each in changed if each.name not in table]
        )
    )
    overrides = node._parameter_overrides
    for name in table.keys() & overrides.keys():
        overrides[name] = _typed(table[name], overrides[name])
    for name, row in table.items():
        node.declare_parameter(name, row.default, descriptor(row))
        node._parameters[name] = _typed(row, node._parameters[name])
        node._descriptors[name].type = node._parameters[name].type_.value
    _refuse_unknown(node, table)


def values(node: Node, table: Mapping[str, Row]) -> dict[str, Any]:
    """Return the present value of every parameter of a table, in the type of its row."""
    return {name: row.check(node.get_parameter(name).value, name) for name, row in table.items()}


def changed_values(table: Mapping[str, Row], changed: Sequence[Parameter]) -> dict[str, Any]:
    """Return the values of those changed parameters that belong to a table, checked."""
    return {
        parameter.name: table[parameter.name].check(_plain(parameter.value), parameter.name)
        for parameter in changed
        if parameter.name in table
    }


def _plain(value: Any) -> Any:
    """Return a list for an array, which a refusal would print as such."""
    return value.tolist() if isinstance(value, array) else value


def refused(error: Exception) -> SetParametersResult:
    """Refuse a change with a sentence."""
    return SetParametersResult(successful=False, reason=str(error))


def unknown(name: str, table: Mapping[str, Row]) -> ConfigError:
    """Say that there is no such parameter."""
    return ConfigError(unknown_name(name, name, table, 'the parameters given'))


def descriptor(row: Row) -> ParameterDescriptor:
    """
    Describe a parameter for ``ros2 param describe`` and rqt.

    Typing is dynamic because ROS takes ``4`` for another type than ``4.0``, and an empty list for
    one of bytes; the row checks the type instead.
    """
    return ParameterDescriptor(
        description=f'{row.description} [{row.unit}]' if row.unit else row.description,
        additional_constraints=row.expected,
        read_only=row.applies == AT_START,
        dynamic_typing=True,
        integer_range=_integer_range(row),
        floating_point_range=_floating_point_range(row),
    )


def _integer_range(row: Row) -> list[IntegerRange]:
    if row.kind != 'int' or (row.minimum is None and row.maximum is None):
        return []
    low = -_LARGEST_INTEGER if row.minimum is None else int(row.minimum)
    high = _LARGEST_INTEGER if row.maximum is None else int(row.maximum)
    return [IntegerRange(from_value=low, to_value=high)]


def _floating_point_range(row: Row) -> list[FloatingPointRange]:
    if row.kind != 'float' or (row.minimum is None and row.maximum is None):
        return []
    low = float('-inf') if row.minimum is None else row.minimum
    high = float('inf') if row.maximum is None else row.maximum
    return [FloatingPointRange(from_value=low, to_value=high)]


def _check(table: Mapping[str, Row], changed: Sequence[Parameter]) -> SetParametersResult:
    try:
        changed_values(table, changed)
    except ConfigError as error:
        return refused(error)
    return SetParametersResult(successful=True)


def _typed(row: Row, parameter: Parameter) -> Parameter:
    """
    Return a parameter with the type of its row where ROS cannot know it.

    An empty list has the type of a list of bytes, or none at all where it comes from a file or
    the command line; a whole number is no double.
    """
    kind, value = TYPES[row.kind], parameter.value
    listed = isinstance(value, (list, tuple, array))
    if row.kind.startswith('list') and (value is None or (listed and not value)):
        return Parameter(parameter.name, kind, [])
    if row.kind == 'float' and type(value) is int:
        return Parameter(parameter.name, kind, float(value))
    if row.kind == 'list of float' and listed and all(type(each) is int for each in value):
        return Parameter(parameter.name, kind, [float(each) for each in value])
    return parameter


def _refuse_unknown(node: Node, table: Mapping[str, Row]) -> None:
    for name in node._parameter_overrides:
        if not node.has_parameter(name) and not name.startswith('qos_overrides.'):
            raise unknown(name, table)
