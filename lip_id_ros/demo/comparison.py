"""What `serve` answered, read back from the demo's bag, beside the simulation's truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
import os
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.demo import topics
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import Outcome, run
from lip_id_ros.model import TorqueModel
from lip_id_ros.recording.bags import Bag
from lip_id_ros.simulation.arm import Dynamics


@dataclass(frozen=True)
class Served:
    """
    A stream of references and its answers, N of them in the order of time.

    Attributes
    ----------
    stamps : ndarray of int64, shape (N,)
        [ns].
    q, dq, ddq : ndarray, shape (N, n)
        The references.
    measured : ndarray, shape (N, n)
        Torques measured on the arm at the same stamps [N m].
    tau : ndarray, shape (N, n)
        Torques answered [N m].
    kinetic, potential : ndarray, shape (N,)
        Energies answered [J].

    """

    stamps: IntArray
    q: Array
    dq: Array
    ddq: Array
    measured: Array
    tau: Array
    kinetic: Array
    potential: Array


def read_served(bag_path: str | os.PathLike[str], joint_names: tuple[str, ...]) -> Served:
    """
    Read the stream from a bag of the demo.

    Parameters
    ----------
    bag_path : path
        A bag with the topics of `lip_id_ros.demo.topics`.
    joint_names : tuple of str
        Joints, in the order wanted.

    Raises
    ------
    DataError
        If a reference was not answered, or an answer has no reference, torque or energy.

    """
    with Bag(bag_path) as bag:
        references = _by_stamp(bag, topics.REFERENCE)
        measured = _by_stamp(bag, topics.JOINT_STATES)
        torques = _by_stamp(bag, topics.TORQUE)
        kinetic = [message.data for _, message in bag.messages(topics.KINETIC)]
        potential = [message.data for _, message in bag.messages(topics.POTENTIAL)]
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
    )


def outcome_of(served: Served, arm: Dynamics, predictor: TorqueModel) -> Outcome:
    """
    Set the answers beside the truth.

    Parameters
    ----------
    served : Served
    arm : Dynamics
        The simulated arm, which knows the truth.
    predictor : TorqueModel
        Of the served model; gives what is not published: the parts of the torque.

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
        if topic != topics.REFERENCE:
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
    counts = {n_references, len(answered), len(kinetic), len(potential)}
    if len(counts) > 1 or not n_references:
        raise DataError(
            f'every reference needs a torque and two energies, but of {n_references} references '
            f'{len(answered)} have a torque, and there are {len(kinetic)} kinetic and '
            f'{len(potential)} potential energies; messages were lost, run it on an idle machine.'
        )
