"""What each pass over a fleet returns: arrays and texts that processes, caches and files take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.packable import Packable

FITTED, EXCLUDED, FAILED = 'fitted', 'excluded', 'failed'
"""Status of a recording: in the fit, left out since it contradicts the fleet, or unreadable."""


@dataclass(frozen=True, eq=False)
class Refusal(Packable):
    """Why a recording cannot be used, whatever the number of attempts."""

    KIND = 'refusal'
    reason: str


@dataclass(frozen=True, eq=False)
class Survey(Packable):
    """
    What the first pass keeps of a recording.

    Attributes
    ----------
    key : str
        Fingerprint of the content: copies of a recording have the same.
    name : str
        Where it was read from.
    group : str
        Robot.
    joint_names, joint_types : tuple of str
    gravity_compensated : bool
    t : array, shape (m,)
        Times of the reservoir, some samples that cover the motion [s].
    q, dq, ddq, tau, low_passed_sign : arrays, shape (m, n)
        The reservoir; signs only where the data set has them.
    dahl_states : array, shape (m, n, D)
    segment : int array, shape (m,)
    n_samples : int
        Of the recording, after preprocessing.
    rate_hz : float
        Of the messages; 0 where it is not known.
    seconds : float
        From the first sample to the last, without gaps between segments.
    start_s : float
        Time of the first message [s].
    health : tuple of str
        Warnings and errors, a line each.
    low, high : arrays, shape (3, n)
        Ranges of q, dq, ddq.
    largest_torque : array, shape (n,)
        [N m or N].
    mean_q : array, shape (n,)
        [rad or m].
    provenance : str
        JSON: the source's entry in the provenance of its data set.
    temperature : float
        Mean of the recording [degrees Celsius]; not a number where no topic has it.

    """

    KIND = 'survey'
    key: str
    name: str
    group: str
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    gravity_compensated: bool
    t: Array
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    low_passed_sign: Array | None
    dahl_states: Array | None
    segment: IntArray
    n_samples: int
    rate_hz: float
    seconds: float
    start_s: float
    health: tuple[str, ...]
    low: Array
    high: Array
    largest_torque: Array
    mean_q: Array
    provenance: str
    temperature: float = np.nan


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordingResult:
    """
    Result of a fleet's fit for one recording.

    Attributes
    ----------
    name, group : str
    status : str
        `FITTED`, `EXCLUDED` or `FAILED`.
    reason : str
        Why it is not in the fit; empty where it is.
    n_samples : int
    rate_hz, seconds, start_s, temperature : float
        As in `Survey`; not a number where it could not be read.
    health : tuple of str
    residual_rms : array, shape (n,)
        With the links of the fleet and the friction of this recording [N m or N].
    friction, friction_std : arrays, shape (K,)
        Coefficients in this recording, in the order of `FleetResult.friction_names`, and their
        standard deviations.

    """

    name: str
    group: str
    status: str
    reason: str
    n_samples: int = 0
    rate_hz: float = np.nan
    seconds: float = np.nan
    start_s: float = np.nan
    temperature: float = np.nan
    health: tuple[str, ...] = ()
    residual_rms: Array
    friction: Array
    friction_std: Array


@dataclass(frozen=True, eq=False)
class FleetResult:
    """
    Model of a fleet, and what each recording contributes.

    Attributes
    ----------
    model : InverseDynamicsModel
    recordings : tuple of RecordingResult
        In the order of the sources.
    friction_names : tuple of str
        Of the K coefficients: joint and term.
    noise_std : array, shape (n,)
        Of links with the friction of each recording, without Gaussian processes [N m or N].
    deviation_of_recordings, deviation_of_groups : arrays, shape (K,)
        Standard deviations of the coefficients between recordings of a robot, and between robots;
        0 where they are not estimated.

    """

    model: InverseDynamicsModel
    recordings: tuple[RecordingResult, ...]
    friction_names: tuple[str, ...]
    noise_std: Array
    deviation_of_recordings: Array
    deviation_of_groups: Array
