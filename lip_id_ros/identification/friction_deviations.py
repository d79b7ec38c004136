"""
Friction that differs between robots g and recordings r.

C + u_g + v_r (maths.md, section 14). Restricted maximum likelihood (Patterson and Thompson,
Biometrika 1971) by Newton steps with average information (Gilmour, Thompson and Cullis, Biometrics
1995).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse.csgraph import connected_components

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray

ROUNDS, TOLERANCE = 200, 1e-11
"""Most Newton steps, and the relative change of deviations at which they end."""

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-8, 1e12
"""Of the steps, in diagonals of the average information."""

ROUNDING = 1e-9
"""Loss of log likelihood that counts as none."""

RANK = 1e-13
"""Least eigenvalue of a precision, as a share of the largest, that counts as information."""

LEAST_GROUPS = 3
"""With fewer recordings, or robots, no deviations between them are estimated."""


@dataclass(frozen=True, eq=False)
class Effects:
    """Deviations of random effects, and the effects themselves."""

    recordings: Array  # (k,), deviations of v; 0 where not estimated
    groups: Array  # (k,), deviations of u, likewise
    mean: Array  # (R, k), posterior means of u_g + v_r
    std: Array  # (R, k), deviations of c + u_g + v_r
    centre: Array  # (k,), change of c that restricted likelihood makes


@dataclass(frozen=True, eq=False)
class NestedEffects:
    """Least squares of a coefficient vector per recording."""

    normal: Array  # (R, k, k), F^T F in units of the noise
    right: Array  # (R, k), F^T r of residuals with the coefficients c
    group: IntArray  # (R,), number of the robot, from 0

    def estimated(self, start: Array) -> Effects:
        """Estimate the deviations, from first ones of shape (k,); zeros stay zero."""
        count, n_groups = len(self.normal), int(self.group.max()) + 1
        nested = LEAST_GROUPS <= n_groups < count
        first = start**2 * np.array([[count >= LEAST_GROUPS], [nested]])
        stack = _Stack.of(self, start > 0.0)
        return stack.effects(_maximised(stack, stack.of_components(first)))

    def given(self, recordings: Array, groups: Array) -> Effects:
        """Return the effects for given deviations, shapes (k,); zeros are no effects."""
        stack = _Stack.of(self, recordings + groups > 0.0)
        return stack.effects(stack.at(stack.of_components(np.stack([recordings, groups]) ** 2)))

    def about_fleet(self, deviations: Array) -> Effects:
        """Return the effects of recordings alone about the coefficients c, which stay."""
        scaled = self.normal * deviations[:, None] * deviations
        inverse = np.linalg.inv(np.eye(len(deviations)) + scaled)
        covariance = inverse * deviations[:, None] * deviations
        mean = np.einsum('rij,rj->ri', covariance, self.right)
        std = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        zero = np.zeros_like(deviations)
        return Effects(deviations, zero, mean, std, zero)


@dataclass(frozen=True, eq=False)
class _Stack:
    """
    Normal equations of coefficients that depend on each other, those of one joint as a rule.

    `systems`, shape (k, k + 1, C, R), has those of C components, recordings sorted by robot. Row j
    of component c is coefficient `table[j, c]`; those that vary come first, `size` means none.
    """

    systems: Array
    table: IndexArray
    n_varying: int
    order: IndexArray
    group: IntArray
    size: int

    @classmethod
    def of(cls, effects: NestedEffects, varies: BoolArray) -> _Stack:
        """Stack the components of some normal equations."""
        order, size = np.argsort(effects.group, kind='stable'), varies.size
        normal = np.pad(effects.normal[order], ((0, 0), (0, 1), (0, 1)))
        right = np.pad(effects.right[order], ((0, 0), (0, 1)))
        count, label = connected_components(np.abs(normal).sum(axis=0) > 0.0, directed=False)
        varies = np.append(varies, False)
        first = np.argsort(~varies, kind='stable')
        components = [first[label[first] == k] for k in range(count)]
        most = max(map(len, components))
        table = np.array([np.pad(c, (0, most - c.size), constant_values=size) for c in components])
        n_varying = max(1, int(np.sum(varies[table], axis=1).max()))
        square = normal[:, table[:, :, None], table[:, None, :]]
        whole = np.concatenate([square, right[:, table][..., None]], axis=3)
        systems = np.ascontiguousarray(whole.transpose(2, 3, 1, 0))
        return cls(systems, table.T, n_varying, order, effects.group[order], size)

    def of_components(self, values: Array) -> Array:
        """Take from values of coefficients, (..., k), those of effects, shape (..., V, C)."""
        padded = np.append(values, np.zeros((*values.shape[:-1], 1)), axis=-1)
        return np.asarray(padded[..., self.table[: self.n_varying]])

    def at(self, variances: Array, systems: Array | None = None) -> _Posterior:
        """Integrate out effects of recordings, those of robots, and c; variances (2, V, C)."""
        whole = self.systems if systems is None else systems
        starts = np.flatnonzero(np.diff(self.group, prepend=-1))
        recordings, first = _integrated(whole, variances[0])
        groups, second = _integrated(np.add.reduceat(recordings, starts, axis=3), variances[1])
        whole = groups.sum(axis=3)
        covariance, third = _inverted(whole[:, : len(whole)])
        centre = _product(covariance, whole[:, len(whole) :])[..., None]
        above = _Level(groups, variances[1], centre)
        own = _Level(recordings, variances[0], above.mean[..., self.group])
        return _Posterior(
            self, variances, own, above, covariance[..., None], first + second + third
        )

    def effects(self, found: _Posterior) -> Effects:
        """Put the effects of all components together, recordings in their own order."""
        last, centre = found.recordings, found.groups.above[:, 0]
        spread = last.spread(found.covariance_of_groups[..., self.group])
        mean, variance = np.zeros((2, self.order.size, self.size + 1))
        middle, within, between = np.zeros((3, self.size + 1))
        rows = self.order[:, None, None]
        mean[rows, self.table] = np.moveaxis(last.mean[:, 0] - centre, -1, 0)
        variance[rows, self.table] = np.einsum('kkcr->rkc', spread)
        middle[self.table] = centre[..., 0]
        varying = self.table[: self.n_varying]
        within[varying], between[varying] = np.sqrt(found.variances)
        std = np.sqrt(np.maximum(variance[:, :-1], 0.0))
        return Effects(within[:-1], between[:-1], mean[:, :-1], std, middle[:-1])


@dataclass(frozen=True, eq=False)
class _Level:
    """
    Effects of recordings, or of robots, about a mean that is estimated above.

    An effect with variance d and design Z has the posterior mean d Z^T P r and the variance d -
    d^2 Z^T P Z, where P is the weight of residuals whose mean is estimated too (Robinson,
    Statistical Science 1991). `systems`, shape (k, k + m, C, N), are normal equations of the mean
    for m right sides, effects integrated out; `above`, shape (k, m, C, N or 1), is that mean.
    """

    systems: Array
    variances: Array
    above: Array

    @cached_property
    def score(self) -> Array:
        """Z^T P r of each effect, shape (V, m, C, N)."""
        n, k = len(self.variances), len(self.systems)
        weight, right = self.systems[:n, :k], self.systems[:n, k:]
        return np.asarray(right - _product(weight, self.above))

    @cached_property
    def mean(self) -> Array:
        """Posterior mean of mean and effect, shape (k, m, C, N)."""
        shape = *self.above.shape[:3], self.systems.shape[3]
        mean = np.array(np.broadcast_to(self.above, shape))
        mean[: len(self.variances)] += self.variances[:, None, :, None] * self.score
        return mean

    def slope(self, covariance: Array) -> Array:
        """Differentiate the log likelihood by variances, (V, C), given the mean's covariance."""
        weight = self.systems[: len(self.variances), : len(self.systems)]
        unknown = np.sum(_product(weight, covariance) * weight, axis=1)
        own = np.einsum('kkcr->kcr', weight[:, : len(weight)])
        return np.asarray(0.5 * np.sum(self.score[:, 0] ** 2 - own + unknown, axis=2))

    def spread(self, covariance: Array) -> Array:
        """Return the covariance of mean and effect, (k, k, C, N), given the mean's."""
        k, n = len(self.systems), len(self.variances)
        variances = np.zeros((k, *self.variances.shape[1:], 1))
        variances[:n, :, 0] = self.variances
        identity = np.eye(k)[..., None, None]
        rest = identity - variances[:, None] * self.systems[:, :k]
        inner = _product(covariance, rest.swapaxes(0, 1)) + identity * variances
        return _product(rest, inner)


@dataclass(frozen=True, eq=False)
class _Posterior:
    """Effects for variances (2, V, C), covariance of c (k, k, C, 1), log determinants (C,)."""

    stack: _Stack
    variances: Array
    recordings: _Level
    groups: _Level
    covariance: Array
    log_determinants: Array

    @cached_property
    def covariance_of_groups(self) -> Array:
        """Of c + u, shape (k, k, C, G)."""
        return self.groups.spread(self.covariance)

    @cached_property
    def likelihood(self) -> Array:
        """Restricted log likelihood of each component up to a constant, shape (C,)."""
        right, mean = self.stack.systems[:, -1], self.recordings.mean[:, 0]
        return np.asarray(0.5 * (np.sum(right * mean, axis=(0, 2)) - self.log_determinants))

    def step(self, damping: Array, varies: BoolArray) -> Array:
        """Return a Newton step of the variances that are not held at zero, shape (2, V, C)."""
        above = self.covariance_of_groups[..., self.stack.group]
        slope = np.stack([self.recordings.slope(above), self.groups.slope(self.covariance)])
        is_free = varies & ((self.variances > 0.0) | (slope > 0.0))
        free = is_free.reshape(-1, is_free.shape[2]).T
        matrix = self._average_information() * free[:, :, None] * free[:, None]
        diagonal = np.einsum('cii->ci', matrix)  # a view
        diagonal *= 1.0 + damping[:, None]
        diagonal += diagonal == 0.0
        right = free * slope.reshape(-1, slope.shape[2]).T
        step = np.linalg.solve(matrix, right[..., None])[..., 0]
        return np.asarray(step.T.reshape(slope.shape))

    def _average_information(self) -> Array:
        """Return half of w_k^T P w_l, where w_k = Z_k Z_k^T P r, shape (C, 2V, 2V)."""
        stack, levels = self.stack, (self.recordings, self.groups)
        own, robots = (each.score[:, 0] for each in levels)
        weight = stack.systems[:, : len(stack.systems)]
        varying = weight[:, : len(own)]
        working = weight, varying * own, varying * robots[..., stack.group]
        other = stack.at(self.variances, np.concatenate(working, axis=1))
        rows = [
            np.einsum('vcn,vmcn->cmv', score, level.score)
            for score, level in ((own, other.recordings), (robots, other.groups))
        ]
        return np.asarray(0.5 * np.concatenate(rows, axis=2))


def _maximised(stack: _Stack, first: Array) -> _Posterior:
    """
    Maximise the restricted likelihood of all components, from first variances (2, V, C).

    Those between recordings come before those between groups; zeros stay zero.
    """
    varies, at = first > 0.0, stack.at(first)
    moving = varies.any(axis=(0, 1))
    damping = np.full(moving.size, FIRST_DAMPING)
    for _ in range(ROUNDS):
        if not moving.any():
            break
        moved = np.maximum(at.variances + at.step(damping, varies), 0.0)
        tried = stack.at(np.where(moving, moved, at.variances))
        gains = tried.likelihood >= at.likelihood - ROUNDING
        change = np.abs(tried.variances - at.variances)
        is_small = np.all(change <= TOLERANCE * tried.variances, axis=(0, 1))
        moving &= ~(gains & is_small) & (damping < MOST_DAMPING)
        damping = np.maximum(damping * np.where(gains, 0.1, 10.0), LEAST_DAMPING)
        at = tried if gains.all() else stack.at(np.where(gains, tried.variances, at.variances))
    return at


def _integrated(systems: Array, variances: Array) -> tuple[Array, Array]:
    """
    Integrate out independent effects of variances (V, C), each a change of rank one.

    From normal equations W, B of the sum of mean and effects, shape (k, k + m, C, N), returns (I +
    W D)^-1 [W, B] of the mean, and log det(I + W D) summed over members, shape (C,).
    """
    out, logs = systems.copy(), np.zeros(variances.shape[1])
    for k, variance in enumerate(variances):
        if not variance.any():
            continue
        d = variance[:, None]
        pivot = 1.0 + d * out[k, k]
        row = out[k] / pivot
        out -= (d * out[:, k])[:, None] * row
        out[k], out[:, k] = row, row[: len(out)]
        logs += np.log(pivot).sum(axis=1)
    return out, logs


def _inverted(precision: Array) -> tuple[Array, Array]:
    """Return pseudo-inverses of matrices (k, k, C), and the logs of their determinants (C,)."""
    values, vectors = np.linalg.eigh(precision.transpose(2, 0, 1))
    informed = values > RANK * values[:, -1:]
    values = np.where(informed, values, 1.0)
    inverse = np.einsum('cik,ck,cjk->ijc', vectors, informed / values, vectors)
    return np.ascontiguousarray(inverse), np.log(values).sum(axis=1)


def _product(a: Array, b: Array) -> Array:
    """Return the products of matrices whose rows and columns are the first dimensions."""
    return np.asarray(sum(a[:, j, None] * b[j] for j in range(len(b))))
