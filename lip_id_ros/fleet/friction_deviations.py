"""
Friction that differs between robots and between recordings of a robot: nested random effects.

Coefficients of recording r of robot g are c + u_g + v_r. The deviations of u and v are those of
restricted maximum likelihood (Patterson and Thompson, Biometrika 1971), found by expectation
maximisation (Laird and Ware, Biometrics 1982; docs/maths.md, section 14).

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, IntArray

ROUNDS, TOLERANCE = 500, 1e-5
"""Most rounds, and the relative change of deviations at which they end."""

LEAST = 1e-6
"""Least deviation, as a share of the first one: a deviation of zero would stay there."""

LEAST_GROUPS = 3
"""With fewer recordings, or robots, no deviations between them are estimated."""


@dataclass(frozen=True, eq=False)
class Effects:
    """
    Deviations of random effects, and the effects themselves.

    Attributes
    ----------
    recordings, groups : arrays, shape (k,)
        Standard deviations of v and of u; 0 where they are not estimated.
    mean : array, shape (R, k)
        Posterior means of u_g + v_r.
    std : array, shape (R, k)
        Their standard deviations.
    centre : array, shape (k,)
        Change of c that restricted maximum likelihood makes.

    """

    recordings: Array
    groups: Array
    mean: Array
    std: Array
    centre: Array


@dataclass(frozen=True, eq=False)
class NestedEffects:
    """
    Least squares of a coefficient vector per recording.

    Attributes
    ----------
    normal : array, shape (R, k, k)
        F^T F of every recording, in units of the noise.
    right : array, shape (R, k)
        F^T r, of residuals with the coefficients c.
    group : int array, shape (R,)
        Number of the robot, from 0.

    """

    normal: Array
    right: Array
    group: IntArray

    def estimated(self, start: Array) -> Effects:
        """Estimate the deviations, from first ones of shape (k,)."""
        count, n_groups = len(self.normal), int(self.group.max()) + 1
        floor = (LEAST * start) ** 2
        nested = LEAST_GROUPS <= n_groups < count
        recordings = start**2 if count >= LEAST_GROUPS else np.zeros_like(start)
        groups = start**2 if nested else np.zeros_like(start)
        for _ in range(ROUNDS if count >= LEAST_GROUPS else 0):
            before = np.concatenate([recordings, groups])
            step = _Expectation(self, recordings, groups)
            recordings = np.maximum(step.recording_squares(), floor)
            groups = np.maximum(step.group_squares(), floor) if nested else groups
            change = np.abs(np.concatenate([recordings, groups]) - before)
            if np.all(change <= TOLERANCE * np.maximum(before, np.tile(floor, 2))):
                break
        return self.given(np.sqrt(recordings), np.sqrt(groups))

    def given(self, recordings: Array, groups: Array) -> Effects:
        """Return the effects for given deviations, shapes (k,); zeros are no effects."""
        step = _Expectation(self, recordings**2, groups**2)
        return Effects(recordings, groups, *step.totals(), step.centre)

    def about_fleet(self, deviations: Array) -> Effects:
        """Return the effects of recordings alone about the coefficients c, which stay."""
        covariance = _covariance(self.normal, deviations**2)
        mean = np.einsum('rij,rj->ri', covariance, self.right)
        variance = np.diagonal(covariance, axis1=1, axis2=2)
        zero = np.zeros_like(deviations)
        return Effects(deviations, zero, mean, np.sqrt(variance), zero)


class _Expectation:
    """Posterior of all effects for given variances, zeros included."""

    def __init__(self, effects: NestedEffects, recordings: Array, groups: Array) -> None:
        normal, right, self._group = effects.normal, effects.right, effects.group
        n_groups = int(self._group.max()) + 1
        self._within = _covariance(normal, recordings)
        seen = normal @ self._within
        information = normal - seen @ normal  # on c + u_g, with v integrated out
        evidence = right - np.einsum('rij,rj->ri', seen, right)
        whole = _summed(information, self._group, n_groups)
        between = _covariance(whole, groups)
        share = whole @ between
        precision = np.sum(whole - share @ whole, axis=0)
        toward = _summed(evidence, self._group, n_groups)
        residual = toward - np.einsum('gij,gj->gi', share, toward)
        centre_covariance = np.linalg.pinv(precision, hermitian=True)
        self.centre = centre_covariance @ residual.sum(axis=0)
        pull = np.swapaxes(share, 1, 2)
        self._u = np.einsum('gij,gj->gi', between, toward - whole @ self.centre)
        self._u_covariance = between + pull @ centre_covariance @ share
        # of c + u_g, whose error a recording's own effect follows
        identity = np.eye(len(self.centre))
        self._both = between + (identity - pull) @ centre_covariance @ (identity - share)
        own = right - np.einsum('rij,rj->ri', normal, (self.centre + self._u)[self._group])
        self._v = np.einsum('rij,rj->ri', self._within, own)
        follow = self._within @ normal
        self._v_covariance = self._within + follow @ self._both[self._group] @ np.swapaxes(
            follow, 1, 2
        )
        self._follow = follow

    def recording_squares(self) -> Array:
        """Return mean expected squares of v, shape (k,)."""
        diagonal = np.diagonal(self._v_covariance, axis1=1, axis2=2)
        return np.asarray(np.mean(self._v**2 + diagonal, axis=0))

    def group_squares(self) -> Array:
        """Return mean expected squares of u, shape (k,)."""
        diagonal = np.diagonal(self._u_covariance, axis1=1, axis2=2)
        return np.asarray(np.mean(self._u**2 + diagonal, axis=0))

    def totals(self) -> tuple[Array, Array]:
        """Return means of u + v and standard deviations of c + u + v, shapes (R, k)."""
        rest = np.eye(len(self.centre)) - self._follow
        covariance = self._within + rest @ self._both[self._group] @ np.swapaxes(rest, 1, 2)
        variance = np.diagonal(covariance, axis1=1, axis2=2)
        return self._u[self._group] + self._v, np.sqrt(np.maximum(variance, 0.0))


def _covariance(information: Array, variance: Array) -> Array:
    """Return (W + D^-1)^-1 for a diagonal D that may have zeros, shape of W."""
    std = np.sqrt(variance)
    scaled = information * std[:, None] * std
    inverse: Array = np.linalg.inv(np.eye(len(std)) + scaled)
    return inverse * std[:, None] * std


def _summed(values: Array, group: IntArray, count: int) -> Array:
    out = np.zeros((count, *values.shape[1:]))
    np.add.at(out, group, values)
    return out
