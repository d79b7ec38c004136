"""
Friction that differs between robots and between recordings of a robot: nested random effects.

Coefficients of recording r of robot g are c + u_g + v_r. The deviations of u and v are those of
restricted maximum likelihood (Patterson and Thompson, Biometrika 1971), found by expectation
maximisation (Laird and Ware, Biometrics 1982; docs/maths.md, section 14).

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse.csgraph import connected_components

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray

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
        """Estimate the deviations, from first ones of shape (k,); zeros stay zero."""
        count, n_groups = len(self.normal), int(self.group.max()) + 1
        nested = LEAST_GROUPS <= n_groups < count
        first = start**2 * np.array([[count >= LEAST_GROUPS], [nested]])
        components = self._components(start)
        std = np.sqrt(_maximised(self, components, first))
        parts = [(some, self._part(some).given(*std[:, some])) for some in components]
        return _joined(parts, start.size)

    def _components(self, start: Array) -> list[IndexArray]:
        """Return the coefficients that depend on each other, those of one joint as a rule."""
        _, label = connected_components(np.abs(self.normal).sum(axis=0) > 0.0, directed=False)
        varying_first = np.argsort(start == 0.0, kind='stable')
        return [varying_first[label[varying_first] == k] for k in range(int(label.max()) + 1)]

    def _part(self, some: IndexArray) -> NestedEffects:
        """Return the normal equations of some coefficients, which no other depends on."""
        normal = self.normal[:, some[:, None], some]
        return replace(self, normal=normal, right=self.right[:, some])

    def given(self, recordings: Array, groups: Array) -> Effects:
        """Return the effects for given deviations, shapes (k,); zeros are no effects."""
        step = _Posterior(self, recordings**2, groups**2)
        return Effects(recordings, groups, *step.totals(), step.centre)

    def about_fleet(self, deviations: Array) -> Effects:
        """Return the effects of recordings alone about the coefficients c, which stay."""
        covariance = _covariance(self.normal, deviations**2)
        mean = np.einsum('rij,rj->ri', covariance, self.right)
        variance = np.diagonal(covariance, axis1=1, axis2=2)
        zero = np.zeros_like(deviations)
        return Effects(deviations, zero, mean, np.sqrt(variance), zero)


def _maximised(effects: NestedEffects, components: Sequence[IndexArray], first: Array) -> Array:
    """
    Maximise the restricted likelihood by expectation maximisation, all components at once.

    Parameters
    ----------
    effects : NestedEffects
    components : sequence of index arrays
        Coefficients that depend on each other, those that vary first.
    first : array, shape (2, k)
        Variances between recordings and between groups to begin with; zeros stay zero.

    Returns
    -------
    array, shape (2, k)
        Variances.

    """
    size = first.shape[1]
    table = np.full((len(components), max(map(len, components))), size)  # size: no coefficient
    for row, some in zip(table, components, strict=True):
        row[: some.size] = some
    variances = np.column_stack([first, np.zeros(2)])
    floor = LEAST**2 * variances
    n_varying = int(np.sum(variances.any(axis=0)[table], axis=1).max())
    expectation = _Expectation.of(effects, table, n_varying)
    for _ in range(ROUNDS if first.any() else 0):
        before, least = variances[:, table], floor[:, table]
        after = np.maximum(expectation.squares(*np.moveaxis(before, 2, 1)), least)
        variances[:, table] = after
        moves = np.abs(after - before) > TOLERANCE * np.maximum(before, least)
        moving = moves.any(axis=(0, 2))
        if not moving.all():
            table, expectation = table[moving], expectation.select(moving)
        if not moving.any():
            break
    return variances[:, :size]


@dataclass(frozen=True, eq=False)
class _Expectation:
    """
    Mean squares of the effects for given variances, of stacked components.

    An effect with variance d and design Z has the posterior mean d Z^T P r and the variance
    d - d^2 Z^T P Z, where P is the weight of residuals whose mean is estimated too (Robinson,
    Statistical Science 1991). Effects are integrated out one by one: a change of rank one.

    Attributes
    ----------
    systems : array, shape (k, k + 1, C, R)
        Normal equations of C components, recordings sorted by robot.
    n_varying : int
        The first coefficients are those that vary.
    group : int array, shape (R,)
        Sorted.

    """

    systems: Array
    n_varying: int
    group: IntArray

    @classmethod
    def of(cls, effects: NestedEffects, table: IndexArray, n_varying: int) -> _Expectation:
        """Stack components, whose coefficients are rows of a table; k stands for none."""
        order = np.argsort(effects.group, kind='stable')
        normal = np.pad(effects.normal[order], ((0, 0), (0, 1), (0, 1)))
        right = np.pad(effects.right[order], ((0, 0), (0, 1)))
        square = normal[:, table[:, :, None], table[:, None, :]]
        whole = np.concatenate([square, right[:, table][..., None]], axis=3)
        systems = np.ascontiguousarray(whole.transpose(2, 3, 1, 0))
        return cls(systems, n_varying, effects.group[order])

    def select(self, some: BoolArray) -> _Expectation:
        """Return some of the components."""
        return replace(self, systems=np.ascontiguousarray(self.systems[:, :, some]))

    def squares(self, recordings: Array, groups: Array) -> Array:
        """
        Return mean expected squares of v and of u.

        Parameters
        ----------
        recordings, groups : arrays, shape (k, C)
            Variances.

        Returns
        -------
        array, shape (2, C, k)

        """
        first = np.flatnonzero(np.diff(self.group, prepend=-1))
        own = self._integrated(self.systems, recordings)
        between = self._integrated(np.add.reduceat(own, first, axis=3), groups)
        whole = between.sum(axis=3)
        covariance = np.linalg.pinv(whole[:, :-1].transpose(2, 0, 1), hermitian=True)
        covariance = np.ascontiguousarray(covariance.transpose(1, 2, 0))[..., None]  # of c
        centre = np.sum(covariance * whole[:, -1, :, None], axis=1)
        u, u_squares = self._posterior(between, groups, centre, covariance)
        d, identity = groups[:, :, None], np.eye(len(groups))[..., None, None]
        rest = identity - d[:, None] * between[:, :-1]
        error = _product(rest, _product(covariance, rest.swapaxes(0, 1)) + identity * d)
        at = self.group
        _, v_squares = self._posterior(own, recordings, (centre + u)[..., at], error[..., at])
        return np.stack([v_squares.T, u_squares.T])

    def _integrated(self, systems: Array, variances: Array) -> Array:
        """Return the normal equations of a mean whose random effects are integrated out."""
        out = systems.copy()
        for k in range(self.n_varying):
            d = variances[k, :, None]
            row = out[k] / (1.0 + d * out[k, k])
            out -= (d * out[:, k])[:, None] * row
            out[k], out[:, k] = row, row[:-1]
        return out

    def _posterior(
        self, systems: Array, variances: Array, mean: Array, covariance: Array
    ) -> tuple[Array, Array]:
        """Return effects about a mean that is known by its covariance, and their mean squares."""
        some = slice(self.n_varying)
        d, weight = variances[some, :, None], systems[some, :-1]
        score = systems[some, -1] - np.sum(weight * mean, axis=1)
        unknown = np.sum(_product(weight, covariance) * weight, axis=1)
        own = np.moveaxis(np.diagonal(weight), -1, 0)
        effects = np.zeros((len(variances), *score.shape[1:]))
        squares = np.zeros_like(variances)
        effects[some] = d * score
        squares[some] = np.mean(d + d**2 * (score**2 - own + unknown), axis=2)
        return effects, squares


def _product(a: Array, b: Array) -> Array:
    """Return the products of matrices whose rows and columns are the first dimensions."""
    return np.asarray(sum(a[:, j, None] * b[j] for j in range(len(b))))


class _Posterior:
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
        self._u = np.einsum('gij,gj->gi', between, toward - whole @ self.centre)
        # of c + u_g, whose error a recording's own effect follows
        rest = np.eye(len(self.centre)) - share
        self._both = between + np.swapaxes(rest, 1, 2) @ centre_covariance @ rest
        own = right - np.einsum('rij,rj->ri', normal, (self.centre + self._u)[self._group])
        self._v = np.einsum('rij,rj->ri', self._within, own)
        self._follow = self._within @ normal

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


def _joined(parts: Sequence[tuple[IndexArray, Effects]], size: int) -> Effects:
    """Put the effects of all components together."""
    count = len(parts[0][1].mean)
    each, every = np.zeros(size), np.zeros((count, size))
    out = Effects(each, each.copy(), every, every.copy(), each.copy())
    for some, part in parts:
        for name, values in vars(part).items():
            getattr(out, name)[..., some] = values
    return out
