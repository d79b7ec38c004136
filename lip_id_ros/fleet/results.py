"""What each pass over a fleet returns: arrays and texts that processes, caches and files take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.checked_file import Packable
from lip_id_ros.evaluation import Evaluation
from lip_id_ros.model import InverseDynamicsModel

FITTED, EXCLUDED, FAILED, HELD_OUT = 'fitted', 'excluded', 'failed', 'held out'
"""
Status of a recording: in the fit, left out since it contradicts the fleet, unreadable, or kept to
judge the fit by.
"""

ARM = 'joint_names', 'joint_types', 'gravity_compensated'
SIGNALS = 't', 'q', 'dq', 'ddq', 'tau', 'low_passed_sign', 'dahl_states', 'segment'
"""Of a data set, what results of passes keep."""


@dataclass(frozen=True, eq=False)
class Refusal(Packable):
    """Why a recording cannot be used, whatever the number of attempts."""

    KIND = 'refusal'
    reason: str


@dataclass(frozen=True, eq=False)
class Survey(Packable):
    """
    What the first pass keeps of a recording.

    Its reservoir are m samples that cover the motion.
    """

    KIND = 'survey'
    key: str  # fingerprint of the content, the same of copies
    name: str  # where it was read from
    group: str  # robot
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    gravity_compensated: bool
    t: Array  # (m,), of the reservoir [s]
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    low_passed_sign: Array | None  # (m, n), where the data set has them
    dahl_states: Array | None  # (m, n, D)
    segment: IntArray
    n_samples: int  # of the recording, after preprocessing
    rate_hz: float  # of the messages; 0 where not known
    seconds: float  # from first to last sample, without gaps
    motion_s: tuple[float, float]  # in motion, and in motion without repetitions
    start_s: float  # of the first message [s]
    health: tuple[str, ...]  # warnings and errors, a line each
    low: Array  # (3, n), lowest q, dq, ddq
    high: Array
    largest_torque: Array  # (n,) [N m or N]
    mean_q: Array  # (n,) [rad or m]
    provenance: str  # JSON: entry of the source
    temperature: float = np.nan  # mean [degrees Celsius]; nan without a topic


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordingResult:
    """
    Result of a fleet's fit for one recording.

    What is as in `Survey` is nan if it could not be read. Friction of this recording has the K
    coefficients of `FleetResult.friction_names`.
    """

    name: str
    group: str
    status: str  # `FITTED`, `EXCLUDED`, `FAILED` or `HELD_OUT`
    reason: str  # why it is not in the fit, or empty
    n_samples: int = 0
    rate_hz: float = np.nan
    seconds: float = np.nan
    start_s: float = np.nan
    temperature: float = np.nan
    health: tuple[str, ...] = ()
    residual_rms: Array  # (n,), with own friction [N m or N]
    friction: Array  # (K,)
    friction_std: Array  # (K,)


@dataclass(frozen=True, eq=False)
class FleetResult:
    """
    Model of a fleet, and what each recording contributes, in the order of the sources.

    Deviations (K,) of coefficients are between recordings of a robot and between robots, 0 where
    they are not estimated.
    """

    model: InverseDynamicsModel
    recordings: tuple[RecordingResult, ...]
    friction_names: tuple[str, ...]  # K times joint, term and unit
    noise_std: Array  # (n,), without Gaussian processes [N m or N]
    deviation_of_recordings: Array
    deviation_of_groups: Array
    evaluation: Evaluation | None = None  # on what was held out, if anything
