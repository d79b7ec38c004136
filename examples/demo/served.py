"""Record what `serve` answers in the demo, and compare it with the simulation's truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
import importlib
import os
import time
from typing import Any

import numpy as np
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import Outcome, run
from lip_id_ros.model import TorqueModel
from lip_id_ros.nodes import messages, qos
from lip_id_ros.recording.bag_writer import RawBag
from lip_id_ros.recording.bags import Bag
from lip_id_ros.signals.joint_states import NANOSECONDS
from lip_id_ros.simulation import panda, SinusoidTrajectory
from lip_id_ros.simulation.arm import Dynamics, MOTION

JOINT_STATES = '/joint_states'
REFERENCE = '/desired_trajectory'
TORQUE = '/serve/feedforward_torque'
KINETIC = '/serve/kinetic_energy'
POTENTIAL = '/serve/potential_energy'
PLAN_WITH_EFFORT = '/serve/trajectory_with_effort'

TOPICS = {
    JOINT_STATES: 'sensor_msgs/msg/JointState',
    REFERENCE: 'trajectory_msgs/msg/JointTrajectory',
    TORQUE: 'sensor_msgs/msg/JointState',
    KINETIC: 'std_msgs/msg/Float64',
    POTENTIAL: 'std_msgs/msg/Float64',
    PLAN_WITH_EFFORT: 'trajectory_msgs/msg/JointTrajectory',
}


LEAST_ANSWERED = 0.5
"""Share of the references that `serve` answers also on a busy machine, where it skips some."""


class BagRecorder:
    """Write the demo's topics into an open bag as they come; `counts` are by topic."""

    def __init__(self, node: Node, bag: RawBag) -> None:
        self.counts: Counter[str] = Counter()
        self._heard_at = time.monotonic()
        self._node = node
        self._bag = bag
        self._subscriptions = [
            node.create_subscription(
                message_class(kind), topic, self._writer(topic), qos.OUTPUT, raw=True
            )
            for topic, kind in TOPICS.items()
        ]

    @property
    def quiet_s(self) -> float:
        """Time since the last message [s]."""
        return time.monotonic() - self._heard_at

    def stop(self) -> None:
        """Write nothing more."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def _writer(self, topic: str) -> Callable[[bytes], None]:
        def write(data: bytes) -> None:
            self._bag.write(topic, self._node.get_clock().now().nanoseconds, data)
            self.counts[topic] += 1
            self._heard_at = time.monotonic()

        return write


def message_class(kind: str) -> Any:
    """Return the class of a message type such as std_msgs/msg/Float64."""
    package, _, name = kind.split('/')
    return getattr(importlib.import_module(f'{package}.msg'), name)


@dataclass(frozen=True)
class Served:
    """
    The references of a stream that were answered, N of them in the order of time.

    `measured` are torques measured on the arm at the same stamps [ns], `tau` those answered [N m],
    each (N, n); energies answered have shape (N,) [J]. `n_references`: with those overtaken.
    """

    stamps: IntArray
    q: Array
    dq: Array
    ddq: Array
    measured: Array
    tau: Array
    kinetic: Array
    potential: Array
    n_references: int


def read_served(bag_path: str | os.PathLike[str], joint_names: tuple[str, ...]) -> Served:
    """
    Read the stream from a bag of the demo, with its joints in this order.

    DataError if an answer has no reference, torque or energy, or too many references none.
    """
    with Bag(bag_path) as bag:
        references = _by_stamp(bag, REFERENCE)
        measured = _by_stamp(bag, JOINT_STATES)
        torques = _by_stamp(bag, TORQUE)
        kinetic = [message.data for _, message in bag.messages(KINETIC)]
        potential = [message.data for _, message in bag.messages(POTENTIAL)]
    _require_complete(len(references), torques.keys() & references, kinetic, potential)
    stamps = sorted(torques)
    q, dq, ddq = _arrays([references[stamp] for stamp in stamps], joint_names)
    return Served(
        stamps=np.array(stamps, dtype=np.int64),
        q=q,
        dq=dq,
        ddq=ddq,
        measured=_arrays([measured[stamp] for stamp in stamps], joint_names)[0],
        tau=_arrays([torques[stamp] for stamp in stamps], joint_names)[0],
        kinetic=np.array(kinetic),
        potential=np.array(potential),
        n_references=len(references),
    )


def outcome_of(served: Served, arm: Dynamics, predictor: TorqueModel) -> Outcome:
    """
    Set the answers beside the truth, which the simulated arm knows.

    The predictor of the served model gives what is not published: the parts of the torque.
    """
    dataset = Dataset(
        t=1e-9 * (served.stamps - served.stamps[0]),
        q=served.q,
        dq=served.dq,
        ddq=served.ddq,
        tau=served.measured,
        joint_names=arm.joint_names,
        joint_types=arm.joint_types,
        segment=np.zeros(len(served.stamps), dtype=np.int64),
        tau_noiseless=arm.inverse_dynamics(served.q, served.dq, served.ddq),
        kinetic=arm.kinetic(served.q, served.dq),
        potential=arm.potential(served.q),
    )
    computed = run(predictor, dataset)
    answered = replace(
        computed.prediction, tau=served.tau, kinetic=served.kinetic, potential=served.potential
    )
    return replace(computed, prediction=answered)


def _by_stamp(bag: Bag, topic: str) -> dict[int, tuple[Any, ...]]:
    """Return names and arrays of each message; of trajectories only those of one point."""
    entries: dict[int, tuple[Any, ...]] = {}
    for _, message in bag.messages(topic):
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        if topic != REFERENCE:
            entries[stamp] = (message.name, message.effort)
        elif len(message.points) == 1:
            (point,) = message.points
            arrays = (point.positions, point.velocities, point.accelerations)
            entries[stamp] = (message.joint_names, *arrays)
    return entries


def _arrays(entries: list[tuple[Any, ...]], joint_names: tuple[str, ...]) -> Array:
    """Return an array of shape (arrays per entry, entries, joints)."""
    ordered = [
        [
            np.asarray(values)[[list(names).index(name) for name in joint_names]]
            for values in arrays
        ]
        for names, *arrays in entries
    ]
    return np.moveaxis(np.array(ordered), 1, 0)


def _require_complete(
    n_references: int, answered: set[int], kinetic: list[float], potential: list[float]
) -> None:
    is_whole = len(answered) == len(kinetic) == len(potential)
    if not is_whole or len(answered) <= LEAST_ANSWERED * n_references:
        raise DataError(
            f'a torque and two energies were expected for nearly every reference, but of '
            f'{n_references} references {len(answered)} have a torque, and there are '
            f'{len(kinetic)} kinetic and {len(potential)} potential energies; messages were lost, '
            'run it on an idle machine.'
        )


N_POINTS = 100
STEP_S = 0.1


def make_plan(seed: int) -> JointTrajectory:
    """Return the beginning of a motion as a plan of `N_POINTS` points."""
    trajectory = SinusoidTrajectory.random(MOTION, np.random.default_rng(seed))
    t = STEP_S * np.arange(N_POINTS, dtype=np.float64)
    return messages.plan_message(panda().joint_names, t, *trajectory.sample(t))


def require_efforts(bag_path: str | os.PathLike[str]) -> None:
    """
    Raise a DataError unless a bag of the demo has its plan with every effort of every point.

    `serve` may have added points to it.
    """
    with Bag(bag_path) as bag:
        points = [point for _, plan in bag.messages(PLAN_WITH_EFFORT) for point in plan.points]
    n_joints = len(panda().joint_names)
    after = [point.time_from_start for point in points]
    times = Counter(NANOSECONDS * each.sec + each.nanosec for each in after)
    asked = [round(NANOSECONDS * STEP_S * number) for number in range(N_POINTS)]
    n_back = sum(times[each] == 1 for each in asked)
    if n_back != N_POINTS or any(len(point.effort) != n_joints for point in points):
        raise DataError(
            f'a plan of {N_POINTS} points must come back with {n_joints} efforts at each, but '
            f'{n_back} of them came; see nodes.log.'
        )
