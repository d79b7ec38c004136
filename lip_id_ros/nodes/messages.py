"""Conversions between arrays and ROS messages."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
import json
import math
from typing import Any

from builtin_interfaces.msg import Duration, Time
from control_msgs.msg import DynamicInterfaceGroupValues, DynamicJointState, InterfaceValue
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Inertia, InertiaStamped, Vector3
import numpy as np
from pal_statistics_msgs.msg import Statistic, Statistics
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.adaptation.updates import Update
from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.signals.joint_states import NANOSECONDS
from lip_id_ros.signals.joints import RefusedError
from lip_id_ros.signals.status import Status
from lip_id_ros.signals.trajectory_header import read_header

INERTIAS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')


def stamp_at(nanoseconds: int) -> Time:
    """Return a time in nanoseconds as a stamp."""
    sec, nanosec = divmod(nanoseconds, NANOSECONDS)
    return Time(sec=sec, nanosec=nanosec)


def doubles(values: Array) -> array[float]:
    """Return a vector as messages hold it without converting element by element."""
    return array('d', values.tobytes())


def nanoseconds(stamp: Time) -> int:
    """Return a stamp in nanoseconds."""
    return int(NANOSECONDS * stamp.sec + stamp.nanosec)


def torque_message(stamp: Time, names: Sequence[str], tau: Array) -> JointState:
    """Return torques as a JointState with names and efforts only."""
    message = JointState(name=list(names), effort=doubles(tau))
    message.header.stamp = stamp
    return message


def joint_state_message(
    stamp: Time, names: Sequence[str], q: Array, dq: Array, tau: Array
) -> JointState:
    """Return a measured sample, arrays of shape (n,), as a driver publishes it."""
    message = torque_message(stamp, names, tau)
    message.position, message.velocity = doubles(q), doubles(dq)
    return message


def update_message(stamp: Time, source: str, update: Update) -> DynamicInterfaceGroupValues:
    """Return an update of a node, by its full name, in one group: the hash of the model."""
    message = DynamicInterfaceGroupValues(interface_groups=[update.model])
    message.header.stamp, message.header.frame_id = stamp, source
    names, values = update.interface
    message.interface_values = [InterfaceValue(interface_names=names, values=doubles(values))]
    return message


def inertia_message(
    stamp: Time, frame: str, mass: float, centre: Array, inertia: Array
) -> InertiaStamped:
    """Return a mass, its centre (3,) and the inertia about it, as `INERTIAS`."""
    about_centre = dict(zip(INERTIAS, inertia.tolist(), strict=True))
    x, y, z = centre.tolist()
    message = InertiaStamped(inertia=Inertia(m=mass, com=Vector3(x=x, y=y, z=z), **about_centre))
    message.header.stamp, message.header.frame_id = stamp, frame
    return message


def inertia_values(inertia: Inertia) -> tuple[float, Array, Array]:
    """Return mass, centre of mass (3,) and inertia about it (6,)."""
    centre = np.array([inertia.com.x, inertia.com.y, inertia.com.z])
    return inertia.m, centre, np.array([getattr(inertia, name) for name in INERTIAS])


def joint_values_message(
    stamp: Time, names: Sequence[str], values: Mapping[str, Array | BoolArray]
) -> DynamicJointState:
    """Return named values of joints, each of shape (n,)."""
    message = DynamicJointState(joint_names=list(names))
    message.header.stamp = stamp
    message.interface_values = [
        InterfaceValue(interface_names=list(values), values=doubles(row))
        for row in np.stack(list(values.values()), axis=1, dtype=np.float64)
    ]
    return message


def any_joint(message: DynamicJointState, name: str) -> bool:
    """Return whether a named value is not zero at any joint."""
    return any(
        value != 0.0
        for each in message.interface_values
        for key, value in zip(each.interface_names, each.values, strict=False)
        if key == name
    )


def plan_message(
    names: Sequence[str], t: Array, q: Array, dq: Array, ddq: Array, tau: Array | None = None
) -> JointTrajectory:
    """
    Return states (N, n) of joints, at times (N,) from the start [s], as a trajectory.

    Velocities and accelerations that are nan are left out. `tau`: efforts (N, n) [N m or N].
    """
    message = JointTrajectory(joint_names=list(names))
    for row, at in enumerate(t.tolist()):
        sec, nanosec = divmod(round(NANOSECONDS * at), NANOSECONDS)
        point = JointTrajectoryPoint(time_from_start=Duration(sec=sec, nanosec=nanosec))
        point.positions = doubles(q[row])
        if not np.isnan(dq[row]).any():
            point.velocities = doubles(dq[row])
        if not np.isnan(ddq[row]).any():
            point.accelerations = doubles(ddq[row])
        if tau is not None:
            point.effort = doubles(tau[row])
        message.points.append(point)
    return message


def count_points(raw: bytes) -> int:
    """Read the number of points of a serialised JointTrajectory; RefusedError if it is none."""
    return read_header(raw).n_points


def is_sample(raw: bytes) -> bool:
    """Return whether a message can be read as a JointTrajectory of one point."""
    try:
        return count_points(raw) == 1
    except RefusedError:
        return False


def status_message(name: str, hardware: str, status: Status) -> DiagnosticStatus:
    """Return a status as a message: nested values as dotted keys, texts as they are, else JSON."""
    message = DiagnosticStatus(name=name, hardware_id=hardware, message=status.summary)
    message.level = bytes([status.level])
    message.values = [KeyValue(key=key, value=_text(value)) for key, value in _flat(status.values)]
    return message


def status_values(status: DiagnosticStatus) -> dict[str, Any]:
    """Return the values of a status as they were before `status_message`, and its summary."""
    values: dict[str, Any] = {'summary': status.message}
    for pair in status.values:
        *outer, last = pair.key.split('.')
        place = values
        for key in outer:
            place = place.setdefault(key, {})
        place[last] = _value(pair.value)
    return values


def statistics_message(stamp: Time, values: Mapping[str, float]) -> Statistics:
    """Return the values that are finite, by name, with a stamp."""
    message = Statistics()
    message.header.stamp = stamp
    message.statistics = [
        Statistic(name=name, value=value) for name, value in values.items() if math.isfinite(value)
    ]
    return message


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def _flat(values: Mapping[str, Any], prefix: str = '') -> list[tuple[str, Any]]:
    pairs: list[tuple[str, Any]] = []
    for key, value in values.items():
        name = prefix + str(key).replace('.', '_')
        if isinstance(value, Mapping) and value:
            pairs += _flat(value, f'{name}.')
        else:
            pairs.append((name, value))
    return pairs
