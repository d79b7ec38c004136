"""Gaps in the stamps of a recording, found as its messages come."""

from __future__ import annotations

from lip_id_ros.recording.timing import GAP_STEPS
from lip_id_ros.signals.joint_states import NANOSECONDS

LEAST_GAP_S = 0.0625
"""A shorter step is no gap at any rate: preprocessing bridges it, at its default cut-off."""

FORGETTING = 0.05
"""The usual step is the mean of about twenty."""


class Gaps:
    """Count steps between stamps that are many times as long as the usual ones before."""

    def __init__(self) -> None:
        self.count, self.longest_s = 0, 0.0
        self._usual_s = 0.0

    def add(self, step_ns: int) -> None:
        """Judge the step between two stamps [ns]; one that goes back begins anew."""
        step = step_ns / NANOSECONDS
        if step <= 0.0:
            return
        most = GAP_STEPS * (self._usual_s or step)
        if step > max(most, LEAST_GAP_S):
            self.count, self.longest_s = self.count + 1, max(step, self.longest_s)
        usual = self._usual_s or step
        self._usual_s = usual + FORGETTING * (min(step, most) - usual)
