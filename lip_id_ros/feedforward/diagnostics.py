"""The level and the sentence of the diagnostics of `serve`."""

from __future__ import annotations

from collections import Counter

import numpy as np

from lip_id_ros.feedforward.server import Server
from lip_id_ros.signals.health import Health, Level
from lip_id_ros.signals.joints import Refusal


class ServerDiagnostics:
    """
    Judge a server again and again, by what was counted since the last time.

    Parameters
    ----------
    server : Server

    """

    def __init__(self, server: Server) -> None:
        self._server = server
        self._before: Counter[str] = Counter()

    def health(self, failure: str, now: float) -> Health:
        """
        Judge.

        Parameters
        ----------
        failure : str
            Why the last configuration or reload failed, empty where it did not.
        now : float
            [s].

        """
        alarms = self._server.alarms()
        new = alarms - self._before
        self._before = alarms
        if not self._server.active:
            return Health(Level.ERROR, failure) if failure else Health(Level.OK, 'inactive')
        if not self._server.deviations_alive:
            return Health(Level.ERROR, 'the process of the standard deviations has ended')
        if new[Refusal.NOT_FINITE_TORQUE]:
            return Health(Level.ERROR, _in_words(new))
        if self._server.stale:
            return Health(Level.WARN, self._silence(now))
        if new:
            return Health(Level.WARN, _in_words(new))
        if failure:
            return Health(Level.WARN, f'serves the model before: {failure}')
        return Health(Level.OK, 'answering' if self._server.enabled else 'disabled')

    def _silence(self, now: float) -> str:
        largest = float(np.abs(self._server.sent).max(initial=0.0))
        torque = f'torques up to {largest:.3g} N m or N' if largest else 'zero torque'
        return f'no reference for {self._server.silence(now):.1f} s: {torque} published'


def _in_words(new: Counter[str]) -> str:
    return 'messages with trouble: ' + ', '.join(f'{key} {n}' for key, n in sorted(new.items()))
