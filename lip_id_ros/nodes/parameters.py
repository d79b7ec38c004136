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
from lip_id_ros.nodes import qos
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
    Declare every row of a table in its type, with the value that the node was given.

    ConfigError if that is not allowed, or for a name that is not in the table: a misspelt limit
    would stay at its default.
    """
    given = node._parameter_overrides
    for name in given:
        if name not in table and not (node.has_parameter(name) or name.startswith(qos.OVERRIDES)):
            raise unknown(name, table)
    types = [(name, TYPES[row.kind], descriptor(row)) for name, row in table.items()]
    node.declare_parameters('', types, ignore_override=True)
    # set and not declared: rclpy would declare an empty list as one of bytes
    node.set_parameters_atomically(
        [
            _initial(table, given.get(name) or Parameter(name, value=row.default))
            for name, row in table.items()
        ]
    )
    for name, row in table.items():
        node.describe_parameter(name).read_only = row.applies == AT_START


def _initial(table: Mapping[str, Row], parameter: Parameter) -> Parameter:
    """Return a value from a file or the command line, where an empty list has no type."""
    if parameter.value is None and table[parameter.name].kind.startswith('list'):
        parameter = Parameter(parameter.name, value=[])
    return typed(table, parameter)


def typed(table: Mapping[str, Row], parameter: Parameter) -> Parameter:
    """
    Return a parameter in the type of its row, if any; ConfigError if its value is not allowed.

    To ROS a whole number is no double, and an empty list is one of bytes or booleans.
    """
    row, value = table.get(parameter.name), parameter.value
    if row is None:
        return parameter
    # a refusal would print an array as such
    value = row.check(value.tolist() if isinstance(value, array) else value, parameter.name)
    kind = TYPES[row.kind]
    return Parameter(parameter.name, kind, list(value) if isinstance(value, tuple) else value)


def values(node: Node, table: Mapping[str, Row]) -> dict[str, Any]:
    """Return the present value of every parameter of a table, in the type of its row."""
    return {name: row.check(node.get_parameter(name).value, name) for name, row in table.items()}


def changed_values(table: Mapping[str, Row], changed: Sequence[Parameter]) -> dict[str, Any]:
    """Return the values of those changed parameters that belong to a table."""
    return {
        each.name: table[each.name].check(each.value, each.name)
        for each in changed
        if each.name in table
    }


def refused(error: Exception) -> SetParametersResult:
    """Refuse a change with a sentence."""
    return SetParametersResult(successful=False, reason=str(error))


def unknown(name: str, table: Mapping[str, Row]) -> ConfigError:
    """Say that there is no such parameter."""
    return ConfigError(unknown_name(name, name, table, 'the parameters given'))


def descriptor(row: Row) -> ParameterDescriptor:
    """Describe a parameter for ``ros2 param describe`` and rqt."""
    return ParameterDescriptor(
        description=f'{row.description} [{row.unit}]' if row.unit else row.description,
        additional_constraints=row.expected,
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
