"""
Delays of efforts, selected by the prediction of left-out blocks.

A drive measures or transmits its effort late by a constant time, and all drives of a bus may do so
alike. The delay common to all is found first, then those of all joints together, by Newton steps
from it. Errors of delays are those of the mean of the blocks' gradients, since blocks are long
enough to be nearly independent where residuals are not (Bester, Conley and Hansen, Journal of
Econometrics 165, 2011).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import stdtrit

from lip_id_ros.arrays import Array
from lip_id_ros.identification.left_out import Gain
from lip_id_ros.loading.left_out_torques import LAGS_S, LeftOutTorques, Smoothed

COMMON_S = np.linspace(-0.16, 0.16, 17)
"""Delays of all efforts that are tried."""

FARTHEST_S = 0.02
"""Largest delay of a single joint beside the common one: what lags more is no drive's delay."""

REACH_S = float(COMMON_S[-1] + FARTHEST_S + max(map(abs, LAGS_S)))
"""How far from an effort motions are looked at."""

STEP_S = 0.005
"""Of finite differences: small beside a period of the motion."""

LEAST_DELAY_S = 0.0005
COMMON_STEPS, OWN_STEPS = 3, 2

LEVEL = 0.01
"""Probability at which some delay is selected in a recording without one."""


class DelaySelection:
    """Delays of efforts behind motions that are smoothed in some way."""

    def __init__(self, judge: LeftOutTorques, smoothed: Smoothed) -> None:
        self._judge, self._smoothed = judge, smoothed
        self._n = len(judge.noise_std)
        self._known: dict[float, Array] = {}
        self._none = np.zeros(self._n)

    def selected(self) -> tuple[Array, dict[str, Any]]:
        """Return the delay of each joint, 0 where none is sure [s], and figures."""
        common, common_error = self._common()
        found, error = self._own(common)
        squares = [self._squares(self._none)]
        delays = fewest(common, common_error, found, error, self._most_errors(len(squares[0])))
        squares.append(self._squares(delays))
        if not Gain.between(squares[:1], squares[1:]).is_sure(errors=0.0):
            delays, squares[1] = self._none, squares[0]
        before, after = (self._judge.percent(each) for each in squares)
        return delays, {
            'most_likely_delay_s': found.tolist(),
            'delay_std_s': [float(each) if np.isfinite(each) else None for each in error],
            'unexplained_without_delays_percent': before,
            'unexplained_with_delays_percent': after,
        }

    def _most_errors(self, blocks: int) -> float:
        """Return how many standard errors of any delay chance may make (Bonferroni)."""
        return float(stdtrit(blocks - 1, 1.0 - 0.5 * LEVEL / (self._n + 1)))

    def _common(self) -> tuple[float, float]:
        """Return the most likely delay of all efforts, and its standard error [s]."""
        all_joints = np.ones((1, self._n))
        costs = [self._costs(np.full(self._n, delay)).sum() for delay in COMMON_S]
        delay = float(COMMON_S[int(np.argmin(costs))])
        for _ in range(COMMON_STEPS):
            every = np.full(self._n, delay)
            self._judge.estimate_noise(self._grams(every))
            found, error = self._step(every, all_joints)
            delay = float(np.clip(found[0], COMMON_S[0], COMMON_S[-1]))
        return delay, float(error[0])

    def _own(self, common: float) -> tuple[Array, Array]:
        """Return the most likely delays of the joints, and their standard errors, (n,) [s]."""
        delays = np.full(self._n, common)
        for _ in range(OWN_STEPS):
            self._judge.estimate_noise(self._grams(delays))
            delays, error = self._step(delays, np.eye(self._n))
        far = np.abs(delays - common) > FARTHEST_S
        return np.where(far, common, delays), np.where(far, np.inf, error)

    def _step(self, delays: Array, along: Array) -> tuple[Array, Array]:
        """
        Go to the least errors of left-out blocks along some directions.

        `delays`, shape (n,): where to start [s]. `along`, shape (d, n): directions, none of which
        shares a joint with another. Returns delays and their standard errors, (d,) [s]: the start
        and infinity where nothing is found.
        """
        start = along @ delays / along.sum(axis=1)
        slopes, bends = self._derivatives(delays, along)
        bend, found, error = bends.sum(axis=0), start.copy(), np.full(len(along), np.inf)
        some = np.flatnonzero(np.diag(bend) > 0.0)
        inner = np.ix_(some, some)
        move = -np.linalg.lstsq(bend[inner], slopes[:, some].sum(axis=0), rcond=None)[0]
        gradients = slopes[:, some] + bends[:, some[:, None], some] @ move
        apart = np.linalg.lstsq(bend[inner], gradients.T, rcond=None)[0]
        count = len(gradients)
        near = np.abs(move) < FARTHEST_S
        found[some[near]] += move[near]
        error[some[near]] = np.sqrt(count / (count - 1.0) * np.sum(apart**2, axis=1))[near]
        return found, error

    def _derivatives(self, delays: Array, along: Array) -> tuple[Array, Array]:
        """Return first and second derivatives of every block's errors, (K, d) and (K, d, d)."""
        steps = STEP_S * along
        middle = self._costs(delays)
        up = np.array([self._costs(delays + step) for step in steps])
        down = np.array([self._costs(delays - step) for step in steps])
        bends = np.empty((len(middle), len(along), len(along)))
        for i, one in enumerate(steps):
            bends[:, i, i] = up[i] + down[i] - 2.0 * middle
            for j, other in enumerate(steps[:i]):
                mixed = self._costs(delays + one + other) + middle - up[i] - up[j]
                bends[:, i, j] = bends[:, j, i] = mixed
        return (up - down).T / (2.0 * STEP_S), bends / STEP_S**2

    def _costs(self, delays: Array) -> Array:
        """Return the errors of left-out blocks in units of the noise, shape (K,)."""
        return np.asarray(np.sum(self._squares(delays) / self._judge.noise_std**2, axis=1))

    def _squares(self, delays: Array) -> Array:
        return self._judge.squares(self._grams(delays))

    def _grams(self, delays: Array) -> Array:
        grams = [self._at(delay)[:, joint] for joint, delay in enumerate(delays.tolist())]
        return np.stack(grams, axis=1)

    def _at(self, delay: float) -> Array:
        key = round(delay, 7)
        if key not in self._known:
            self._known[key] = self._judge.grams(self._smoothed, delay)
        return self._known[key]


def fewest(common: float, common_error: float, delays: Array, errors: Array, most: float) -> Array:
    """
    Return delays of single joints beside none or a common one, whichever needs fewer.

    `common`, `common_error`: delay of all joints, and its standard error [s]. `delays`, `errors`,
    shape (n,): those of the joints, likewise. `most`: standard errors that chance may make.
    """

    def beside(usual: float) -> tuple[Array, int]:
        far = np.abs(delays - usual) > np.maximum(most * errors, LEAST_DELAY_S)
        return np.where(far, delays, usual), int(np.count_nonzero(far))

    alone, count = beside(0.0)
    if abs(common) <= max(most * common_error, LEAST_DELAY_S):
        return alone
    shared, others = beside(common)
    return shared if count == 0 or others + 1 < count else alone
