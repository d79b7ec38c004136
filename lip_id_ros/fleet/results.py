"""What each pass over a fleet returns: arrays and texts that processes, caches and files take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.evaluation import Evaluation
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.packable import Packable

FITTED, EXCLUDED, FAILED, HELD_OUT = 'fitted', 'excluded', 'failed', 'held out'
"""
Status of a recording: in the fit, left out since it contradicts the fleet, unreadable, or kept to
judge the fit by.
"""


@dataclass(frozen=True, eq=False)
class Refusal(Packable):
    """Why a recording cannot be used, whatever the number of attempts."""

    KIND = 'refusal'
    reason: str


@dataclass(frozen=True, eq=False)
class Survey(Packable):
    """
    What the first pass keeps of a recording.

    `key`: fingerprint of the content: copies of a recording have the same. `name`: where it was
    read from. `group`: robot. `t`, shape (m,): times of the reservoir, some samples that cover the
    motion [s]. `q`, `dq`, `ddq`, `tau`, `low_passed_sign`, shape (m, n): the reservoir; signs only
    where the data set has them. `dahl_states`, shape (m, n, D). `segment`, shape (m,).
    `n_samples`: of the recording, after preprocessing. `rate_hz`: of the messages; 0 where it is
    not known. `seconds`: from the first sample to the last, without gaps between segments.
    `start_s`: time of the first message [s]. `health`: warnings and errors, a line each. `low`,
    `high`, shape (3, n): ranges of q, dq, ddq. `largest_torque`, shape (n,): [N m or N]. `mean_q`,
    shape (n,): [rad or m]. `provenance`: JSON: the source's entry in the provenance of its data
    set. `temperature`: mean of the recording [degrees Celsius]; not a number where no topic has
    it.
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

    `status`: `FITTED`, `EXCLUDED`, `FAILED` or `HELD_OUT`. `reason`: why it is not in the fit;
    empty where it is. `rate_hz`, `seconds`, `start_s`, `temperature`: as in `Survey`; not a number
    where it could not be read. `residual_rms`, shape (n,): with the links of the fleet and the
    friction of this recording [N m or N]. `friction`, `friction_std`, shape (K,): coefficients in
    this recording, in the order of `FleetResult.friction_names`, and their standard deviations.
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

    `recordings`: in the order of the sources. `friction_names`: of the K coefficients: joint, term
    and unit. `noise_std`, shape (n,): of links with the friction of each recording, without
    Gaussian processes [N m or N]. `deviation_of_recordings`, `deviation_of_groups`, shape (K,):
    standard deviations of the coefficients between recordings of a robot, and between robots; 0
    where they are not estimated. `evaluation`: of the model on what was held out, where anything
    was.
    """

    model: InverseDynamicsModel
    recordings: tuple[RecordingResult, ...]
    friction_names: tuple[str, ...]
    noise_std: Array
    deviation_of_recordings: Array
    deviation_of_groups: Array
    evaluation: Evaluation | None = None
