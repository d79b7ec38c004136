"""
Shapes of friction that torques are not linear in.

Widths of signs, harmonics of a ripple. Widths are selected on grids by left-out blocks, harmonics
by a periodogram.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from lip_id_ros.arrays import Array, IndexArray, IntArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.friction_candidates import (
    Candidate,
    has_width,
    plain_candidates,
    saturating_candidates,
    with_width,
)
from lip_id_ros.identification.left_out import Gain, LeftOutBlocks
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.joint_types import REVOLUTE

FIRST, LAST = 8, 400
"""
Harmonics that are looked for. Slower ones could stand in for gravity; a strain wave gear has two
periods in a turn of its motor, which are some hundred in a turn of the joint.
"""

MOST_SAMPLES = 2000
"""Of a periodogram; of more, so many evenly chosen."""

DEPENDENT = 1e-6
"""Least share of a harmonic's square that other features leave."""


def resolved_harmonics(dataset: Dataset, joint: int) -> IntArray:
    """
    Return the harmonics of which a joint covers a period, and which the sampling shows.

    Between half of the neighbouring samples their phase changes by less than a quarter period.
    """
    if dataset.joint_types[joint] != REVOLUTE:
        return np.empty(0, dtype=np.int64)
    q = dataset.q[:, joint]
    harmonics = np.arange(FIRST, LAST + 1)
    covered = harmonics * np.ptp(q) > 2.0 * np.pi
    shown = harmonics * np.median(np.abs(np.diff(q))) < 0.5 * np.pi
    return np.asarray(harmonics[covered & shown])


def strongest_harmonic(q: Array, torque: Array, features: Array, harmonics: IntArray) -> int:
    """
    Return the harmonic that explains most of a torque (N,) beside features (N, p).

    A least-squares periodogram (Lomb, Astrophysics and Space Science 1976) in the position [rad].
    Torque and features are weighted by the roots of the samples' weights, the last feature.
    """
    rows = evenly(len(q), MOST_SAMPLES)
    basis, _ = np.linalg.qr(features[rows])

    def beside(values: Array) -> Array:
        return values - basis @ (basis.T @ values)

    angle, root = np.outer(q[rows], harmonics), features[rows, -1:]
    cosine, sine = beside(root * np.cos(angle)), beside(root * np.sin(angle))
    rest = beside(torque[rows])
    aa, ab, bb = (
        np.sum(x * y, axis=0) for x, y in ((cosine, cosine), (cosine, sine), (sine, sine))
    )
    ra, rb = rest @ cosine, rest @ sine
    determinant = aa * bb - ab**2
    usable = determinant > DEPENDENT * (root**2).sum() ** 2
    squares = np.where(usable, bb * ra**2 - 2.0 * ab * ra * rb + aa * rb**2, 0.0)
    return int(harmonics[np.argmax(squares / np.where(usable, determinant, 1.0))])


Gather = Callable[[Sequence[Candidate], Array], tuple[LeftOutBlocks, list[IndexArray]]]
"""Statistics by blocks of some terms at given loads, and the parameters of every candidate."""

SIGN_WIDTHS = (0.01, 0.015, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.45)
"""Widths of smooth signs that are tried, as shares of each joint's root mean square velocity."""

WIDEST = 0.2
"""
The same of dry friction as a rule. A wider sign is taken only where it gains for sure: it stands
in for other friction, and few samples do not show which.
"""

FINER_STEPS = (0.2, 0.06)
"""
Steps of the logarithms of widths that are tried next, around the best ones. A width between two
of the first ones would be paid for by other terms, and by errors that no deviation shows.
"""


class SignWidths:
    """The selection of widths, for velocities (N, n). The parameters of the links come first."""

    def __init__(self, gather: Gather, dq: Array, n_links: int) -> None:
        self._gather, self._n_links = gather, n_links
        speed = np.sqrt(np.mean(dq**2, axis=0))
        self._speed = np.where(speed > 0.0, speed, 1.0)
        self._tried = np.outer(SIGN_WIDTHS, self._speed)

    def beside(self, chosen: Sequence[Candidate], load: Array) -> Array:
        """Select the width of every joint's smooth sign beside some terms, (n,) [rad/s or m/s]."""
        tried = self._tried
        scores = self._scores(tried, chosen, load)
        for step in FINER_STEPS:
            best = np.take_along_axis(tried, np.argmin(scores, axis=0)[None], axis=0)
            tried = best * np.exp(step * np.arange(-2.0, 3.0))[:, None]
            scores = self._scores(tried, chosen, load)
        return self._usual(_least_between(tried, scores), chosen, load)

    def _usual(self, widths: Array, chosen: Sequence[Candidate], load: Array) -> Array:
        """Return widths of at most `WIDEST`, but for those that gain for sure by being wider."""
        usual = np.minimum(widths, WIDEST * self._speed)
        others, wide = _by_width([*plain_candidates(widths), *chosen])
        options = {
            int(j): [with_width(wide, int(j), float(widths[j]))]
            for j in np.flatnonzero(widths > usual)
        }
        out = usual.copy()
        for j, _, gain in self._exchanged(usual, others, wide, options, load):
            if gain.is_sure():
                out[j] = widths[j]
        return out

    def beside_saturation(self, widths: Array, chosen: Sequence[Candidate], load: Array) -> Array:
        """
        Return other widths (n,) where viscous friction that saturates gains beside them.

        The best width of a single sign stands in for such friction, so that it would not gain.
        """
        others, wide = _by_width([*plain_candidates(widths), *chosen])
        options = {
            j: [with_width([*wide, offer], j, float(width)) for width in self._tried[:, j]]
            for j, offer in enumerate(saturating_candidates(widths))
            if not _among(offer, chosen)
        }
        out = widths.copy()
        for j, best, gain in self._exchanged(widths, others, wide, options, load):
            if gain.is_sure(errors=0.0):
                out[j] = self._tried[best, j]
        return out

    def _exchanged(
        self,
        widths: Array,
        others: Sequence[Candidate],
        wide: Sequence[Candidate],
        options: Mapping[int, Sequence[Candidate]],
        load: Array,
    ) -> Iterator[tuple[int, int, Gain]]:
        """Yield joints, their best option instead of their widths, and what that one gains."""
        if not options:
            return
        alone = [with_width(wide, joint, float(width)) for joint, width in enumerate(widths)]
        every = [each for some in options.values() for each in some]
        blocks, groups = self._gather([*others, *alone, *every], load)
        fixed = np.concatenate([np.arange(self._n_links), *groups[: len(others)]])
        own, more = groups[len(others) :][: len(alone)], groups[len(others) + len(alone) :]
        selected = np.concatenate([fixed, *own])
        noise = blocks.noise(selected)
        now = blocks.fit(selected, noise)
        for joint, some in options.items():
            rest = np.concatenate([fixed, *own[:joint], *own[joint + 1 :]])
            fits = blocks.with_each(rest, more[: len(some)], noise)
            more = more[len(some) :]
            best = int(np.argmin([np.log(fit.mean_squares).sum() for fit in fits]))
            yield joint, best, now.gain(fits[best])

    def _scores(self, tried: Array, chosen: Sequence[Candidate], load: Array) -> Array:
        """
        Return how well left-out blocks are predicted with widths of shape (k, n), same shape.

        The sums over joints of the logarithms of mean squares, each width beside the best of the
        other joints.
        """
        count, n = tried.shape
        others, wide = _by_width([*plain_candidates(tried[0]), *chosen])
        signs = [with_width(wide, joint, float(row[joint])) for row in tried for joint in range(n)]
        blocks, groups = self._gather([*others, *signs], load)
        fixed = np.concatenate([np.arange(self._n_links), *groups[: len(others)]])
        sign = groups[len(others) :]
        scores, index = np.zeros((count, n)), np.full(n, count // 2)
        for _ in range(2):
            before = index.copy()
            noise = blocks.noise(
                np.concatenate([fixed, *(sign[n * k + joint] for joint, k in enumerate(index))])
            )
            for joint in range(n):
                rest = [sign[n * k + other] for other, k in enumerate(index) if other != joint]
                squares = blocks.mean_squares(
                    np.concatenate([fixed, *rest]), sign[joint::n], noise
                )
                scores[:, joint] = [np.log(each).sum() for each in squares]
                index[joint] = np.argmin(scores[:, joint])
            if np.array_equal(index, before):
                break
        return scores


def _by_width(candidates: Sequence[Candidate]) -> tuple[list[Candidate], list[Candidate]]:
    """Return single terms, those without and those with a smooth sign."""
    single = [Candidate((term,)) for each in candidates for term in each.terms]
    others = [each for each in single if not has_width(each)]
    return others, [each for each in single if has_width(each)]


def _among(offer: Candidate, chosen: Sequence[Candidate]) -> bool:
    """Return whether a drive has a term of this kind, of any width."""
    (new,) = offer.terms
    terms = [term for each in chosen for term in each.terms]
    return any(new.drive == old.drive and new.term.kind is old.term.kind for old in terms)


def _least_between(tried: Array, scores: Array) -> Array:
    """Return where parabolas through the least scores of each column are least, shape (n,)."""
    columns = np.arange(tried.shape[1])
    middle = np.clip(np.argmin(scores, axis=0), 1, len(tried) - 2)
    low, least, high = (scores[middle + k, columns] for k in (-1, 0, 1))
    bend = low - 2.0 * least + high
    with np.errstate(divide='ignore', invalid='ignore'):
        place = np.where(bend > 0.0, 0.5 * (low - high) / bend, 0.0)
    step = np.log(tried[1] / tried[0])
    return np.asarray(tried[middle, columns] * np.exp(np.clip(place, -1.0, 1.0) * step))
