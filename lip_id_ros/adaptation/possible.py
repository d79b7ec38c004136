"""The nearest arm that can exist: links with mass and inertia, numbers within their bounds."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import BODY, pseudo_inertia, UNIT_INERTIAS

EXISTS = 0.05
"""Least share of a link's inertia in any direction, in that of the arm that was commissioned."""

NEARLY = 0.1
"""Of this share, with which a link exists all the same."""

ROUNDS = 50
"""Of half-spaces, before what is left is mended by the commissioned arm."""

ON_BOUND = 1e-6
"""Deviations beyond a bound with which a number is taken to be on it."""

_COLUMNS = np.arange(BODY)


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
        whitening = np.linalg.inv(np.linalg.cholesky(pseudo_inertia(links)))[:, None]
        # pseudo-inertias of unit parameters in those of the commissioned arm, (n, 10, 16)
        units = whitening @ UNIT_INERTIAS @ np.swapaxes(whitening, -1, -2)
        self._units = units.reshape(*units.shape[:2], -1)
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
        slack = ON_BOUND * np.linalg.norm(root, axis=1)
        within, found = (self._lower - slack, self._upper + slack), numbers
        slopes, least = self._violated(numbers, within)
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
            more, most = self._violated(found, within)
            if not most.size:
                break
            slopes, least = np.vstack([self._kept[0], more]), np.append(self._kept[1], most)
        return self._mended(found)

    def _violated(self, numbers: Array, within: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return half-spaces a^T x >= b that numbers x are not in: a, shape (m, p), and b."""
        values, vectors = np.linalg.eigh(self._shares(numbers))
        link, k = (values < NEARLY * EXISTS).nonzero()
        low, high = (numbers < within[0]).nonzero()[0], (numbers > within[1]).nonzero()[0]
        first, last = link.size, link.size + low.size
        slopes = np.zeros((last + high.size, numbers.size))
        v = vectors[link, :, k]
        squares = (v[:, :, None] * v[:, None]).reshape(-1, 16, 1)
        columns = LINK_PARAMETERS * link[:, None] + _COLUMNS
        slopes[np.arange(first)[:, None], columns] = (self._units[link] @ squares)[..., 0]
        slopes[np.arange(first, last), low] = 1.0
        slopes[np.arange(last, len(slopes)), high] = -1.0
        least = np.full(len(slopes), EXISTS)
        least[first:last], least[last:] = self._lower[low], -self._upper[high]
        return slopes, least

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
        return (links[:, None, :BODY] @ self._units).reshape(-1, 4, 4)


def least_distance(slopes: Array, least: Array) -> tuple[Array, BoolArray] | None:
    """
    Return the shortest z, shape (r,), with slopes z >= least, and where they are equal, (m,).

    None where there is no such z. Lawson and Hanson, Solving Least Squares Problems (1974),
    chapter 23.4.

    """
    size = np.sqrt(np.einsum('ij,ij->i', slopes, slopes))
    known = size > 0.0
    if not known.all():
        if (least[~known] > 0.0).any():
            return None
        slopes, least, size = slopes[known], least[known], size[known]
    system = np.empty((slopes.shape[1] + 1, size.size))
    np.divide(slopes.T, size, out=system[:-1])
    np.divide(least, size, out=system[-1])
    unit = np.abs(system[-1]).max(initial=0.0) or 1.0
    system[-1] /= unit
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
