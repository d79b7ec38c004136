"""Between messages and arrays."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

Array = NDArray[np.float64]

NANOSECONDS = 1_000_000_000


def stamp_at(nanoseconds: int) -> Time:
    """Return a time in nanoseconds as a stamp."""
    sec, nanosec = divmod(nanoseconds, NANOSECONDS)
    return Time(sec=sec, nanosec=nanosec)


def is_zero(stamp: Time) -> bool:
    """Tell whether a stamp was left empty, which in a trajectory means now."""
    return bool(stamp.sec == 0 and stamp.nanosec == 0)


def doubles(values: Array) -> array[float]:
    """Return a vector as messages hold it without converting element by element."""
    return array('d', values.tobytes())


def torque_message(stamp: Time, names: Sequence[str], tau: Array) -> JointState:
    """Return torques as a JointState with names and efforts only."""
    message = JointState(name=list(names), effort=doubles(tau))
    message.header.stamp = stamp
    return message


def command_message(tau: Array) -> Float64MultiArray:
    """Return torques as forward_command_controller takes them."""
    return Float64MultiArray(data=doubles(tau))


def with_effort(plan: JointTrajectory, tau: Array) -> JointTrajectory:
    """
    Fill in the efforts of a plan.

    Parameters
    ----------
    plan : JointTrajectory
        Is changed and returned: positions, velocities, accelerations and times stay.
    tau : ndarray, shape (number of points, number of its joints)
        Torques [N m or N] in the order of its joint_names.

    """
    for point, effort in zip(plan.points, tau, strict=True):
        point.effort = doubles(effort)
    return plan


def diagnostics_message(
    stamp: Time, name: str, level: bytes, summary: str, values: Mapping[str, Any]
) -> DiagnosticArray:
    """Return one diagnostic status; nested values become dotted keys."""
    status = DiagnosticStatus(name=name, level=level, message=summary, hardware_id='')
    status.values = [KeyValue(key=key, value=str(value)) for key, value in _flat(values)]
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message


def _flat(values: Mapping[str, Any], prefix: str = '') -> list[tuple[str, Any]]:
    pairs: list[tuple[str, Any]] = []
    for key, value in values.items():
        if isinstance(value, Mapping):
            pairs += _flat(value, f'{prefix}{key}.')
        else:
            pairs.append((f'{prefix}{key}', value))
    return pairs
