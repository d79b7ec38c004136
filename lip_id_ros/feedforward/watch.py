"""Whether a stream of references has fallen silent."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array


class Watch:
    """
    Watch a stream from its first answered reference on.

    Attributes
    ----------
    stale : bool
        Whether the silence was noticed.

    """

    def __init__(self) -> None:
        self.stale = False
        self._fed_at: float | None = None
        self._position: Array | None = None
        self._measured: Array | None = None
        self._measured_at = -np.inf

    def feed(self, now: float, position: Array) -> None:
        """
        Note an answered reference.

        Parameters
        ----------
        now : float
            [s], on any steady clock.
        position : ndarray, shape (n,)
            Its positions.

        """
        self._fed_at, self._position, self.stale = now, position, False

    def measure(self, now: float, position: Array) -> None:
        """Note where the arm is."""
        self._measured_at, self._measured = now, position

    def stop(self) -> None:
        """Expect no reference: nobody was told to hold a torque."""
        self._fed_at, self.stale = None, False

    def silence(self, now: float) -> float:
        """Return the time since the last answered reference [s], 0 while none is expected."""
        return 0.0 if self._fed_at is None else now - self._fed_at

    def position(self, now: float, longest_s: float) -> Array | None:
        """Return where the arm is: measured no longer ago than so, else the last reference."""
        fresh = now - self._measured_at <= longest_s
        return self._measured if fresh else self._position
