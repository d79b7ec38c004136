"""The nearest arm that can exist: links with mass and inertia, numbers within their bounds."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import pseudo_inertia

EXISTS = 0.05
"""Least share of a link's inertia in any direction, in that of the arm that was commissioned."""

NEARLY = 0.1
"""Of this share, with which a link exists all the same."""

ROUNDS = 50
"""Of half-spaces, before what is left is mended by the commissioned arm."""

ON_BOUND = 1e-6
"""Deviations beyond a bound with which a number is taken to be on it."""

_BODY = LINK_PARAMETERS - 1
_UNITS = pseudo_inertia(np.eye(_BODY))


def can_exist(links: Array) -> bool:
    """Return whether bodies can have the parameters (n, 11)."""
    with np.errstate(over='ignore', invalid='ignore'):
        inertia = pseudo_inertia(links)
    if not np.isfinite(inertia).all():
        return False
    return bool((links[:, -1] > 0.0).all() and (np.linalg.eigvalsh(inertia) > 0.0).all())


class PossibleArms:
    """
    Numbers of arms that can exist: parameters of links (11 n), then others within bounds (K).

    `links`, shape (n, 11): of the commissioned arm. `lower`, `upper`, shape (K,): bounds.

    """

    def __init__(self, links: Array, lower: Array, upper: Array) -> None:
        self._links = links
        self._whitening = np.linalg.inv(np.linalg.cholesky(pseudo_inertia(links)))
        least = np.full(links.shape, -np.inf)
        least[:, -1] = EXISTS * links[:, -1]
        self._lower = np.append(least, lower)
        self._upper = np.append(np.full(links.size, np.inf), upper)
        # half-spaces that held the last numbers: most of them hold the next
        self._kept = np.empty((0, self._lower.size)), np.empty(0)

    def nearest(self, numbers: Array, root: Array) -> Array:
        """
        Return the nearest numbers that can be, both of shape (11 n + K,).

        Nearest in the metric of the covariance root root^T, with `root` of shape (11 n + K, r), as
        the filter keeps its bounds (Simon, IET Control Theory and Applications 2010, section 2.2).
        A link exists where v^T J v > 0 for all v, a half-space for each v: those that the last
        estimate violates most are added one after the other (Kelley, SIAM Journal 1960).

        """
        found, slack = numbers, ON_BOUND * np.linalg.norm(root, axis=1)
        slopes, least = self._violated(numbers, slack)
        if not least.size:
            return numbers
        slopes, least = np.vstack([self._kept[0], slopes]), np.append(self._kept[1], least)
        for _ in range(ROUNDS):
            nearest = least_distance(slopes @ root, least - slopes @ numbers)
            if nearest is None:
                break
            step, touched = nearest
            found = numbers + root @ step
            self._kept = slopes[touched], least[touched]
            more, most = self._violated(found, slack)
            if not most.size:
                break
            slopes, least = np.vstack([self._kept[0], more]), np.append(self._kept[1], most)
        return self._mended(found)

    def _violated(self, numbers: Array, slack: Array) -> tuple[Array, Array]:
        """Return half-spaces a^T x >= b that numbers x are not in: a, shape (m, p), and b."""
        values, vectors = np.linalg.eigh(self._shares(numbers))
        link, k = np.nonzero(values < NEARLY * EXISTS)
        lower, upper = self._lower, self._upper
        low, high = (np.flatnonzero(x) for x in (numbers < lower - slack, numbers > upper + slack))
        slopes = np.zeros((link.size + low.size + high.size, numbers.size))
        bodies, bounds = np.split(slopes, [link.size])
        v = np.einsum('mba,mb->ma', self._whitening[link], vectors[link, :, k])
        columns = LINK_PARAMETERS * link[:, None] + np.arange(_BODY)
        np.put_along_axis(bodies, columns, np.einsum('ma,kab,mb->mk', v, _UNITS, v), axis=1)
        bounds[np.arange(len(bounds)), np.append(low, high)] = np.repeat(
            [1.0, -1.0], [low.size, high.size]
        )
        return slopes, np.concatenate([np.full(link.size, EXISTS), lower[low], -upper[high]])

    def _mended(self, numbers: Array) -> Array:
        """Return numbers within the bounds, with as much of the commissioned arm as it takes."""
        out = np.clip(numbers, self._lower, self._upper)
        least = np.linalg.eigvalsh(self._shares(out)).min()
        if least < NEARLY * EXISTS:
            share = (NEARLY * EXISTS - least) / (1.0 - least)
            out[: self._links.size] += share * (self._links.ravel() - out[: self._links.size])
        return out

    def _shares(self, numbers: Array) -> Array:
        """Return the pseudo-inertias in those of the commissioned arm, shape (n, 4, 4)."""
        links = numbers[: self._links.size].reshape(self._links.shape)
        return self._whitening @ pseudo_inertia(links) @ np.swapaxes(self._whitening, 1, 2)


def least_distance(slopes: Array, least: Array) -> tuple[Array, BoolArray] | None:
    """
    Return the shortest z, shape (r,), with slopes z >= least, and where they are equal, (m,).

    None where there is no such z. Lawson and Hanson, Solving Least Squares Problems (1974),
    chapter 23.4.

    """
    size = np.linalg.norm(slopes, axis=1)
    known = size > 0.0
    if (least[~known] > 0.0).any():
        return None
    slopes, least = slopes[known] / size[known, None], least[known] / size[known]
    unit = np.abs(least).max(initial=0.0) or 1.0
    system = np.vstack([slopes.T, least / unit])
    wanted = np.zeros(len(system))
    wanted[-1] = 1.0
    try:
        multipliers, _ = nnls(system, wanted)
    except RuntimeError:  # too many steps
        return None
    left = wanted - system @ multipliers
    if left[-1] <= np.finfo(np.float64).eps:
        return None
    touched = np.zeros(known.size, dtype=np.bool_)
    touched[known] = multipliers > 0.0
    return -unit * left[:-1] / left[-1], touched
