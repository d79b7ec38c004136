"""When a demonstration has failed: the same rule with and without ROS."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from lip_id_ros.evaluation import Evaluation
from lip_id_ros.evaluation.tables import percent, Table

TORQUE_LIMIT_PERCENT = 5.0
KINETIC_LIMIT_PERCENT = 2.0
LEAST_SIGNAL_TO_NOISE = 10.0  # below this, an error says more of the noise than of the model


@dataclass(frozen=True)
class Verdict:
    """
    One figure and what is asked of it.

    Attributes
    ----------
    name : str
        Joint, or kinetic energy.
    nmse_percent, limit_percent : float
    judged : bool
        False where the signal is too small to judge by.

    """

    name: str
    nmse_percent: float
    limit_percent: float
    judged: bool = True

    @property
    def failed(self) -> bool:
        """Whether the figure is judged, and is above its limit or no number at all."""
        return self.judged and not self.nmse_percent <= self.limit_percent

    @property
    def word(self) -> str:
        """The verdict in words."""
        if not self.judged:
            return 'not judged: close to the noise'
        return 'TOO LARGE' if self.failed else 'ok'


def judge(evaluation: Evaluation, noise_std: Sequence[float]) -> list[Verdict]:
    """
    Judge the torque of every joint and the kinetic energy.

    Parameters
    ----------
    evaluation : Evaluation
        On an unseen motion, against the truth.
    noise_std : sequence of float, n of them
        Of the simulated torque sensors [N m or N]. A joint whose torque has a standard deviation
        within ten times that is reported, not judged.

    Returns
    -------
    list of Verdict
        The joints from base to tip, then the kinetic energy.

    """
    joints = zip(
        evaluation.joint_names,
        evaluation.nmse_percent,
        evaluation.torque_std,
        noise_std,
        strict=True,
    )
    verdicts = [
        Verdict(name, nmse, TORQUE_LIMIT_PERCENT, judged=std > LEAST_SIGNAL_TO_NOISE * noise)
        for name, nmse, std, noise in joints
    ]
    kinetic = evaluation.kinetic_nmse_percent
    verdicts.append(
        Verdict('kinetic energy', math.nan if kinetic is None else kinetic, KINETIC_LIMIT_PERCENT)
    )
    return verdicts


def verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Return the verdicts as a table."""
    rows = [
        (verdict.name, percent(verdict.nmse_percent), f'{verdict.limit_percent:g}', verdict.word)
        for verdict in verdicts
    ]
    return Table('Verdict', ('', 'nMSE [%]', 'limit [%]', ''), rows)
