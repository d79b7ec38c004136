"""
Episodes with a contact, or with efforts that are not measured (maths.md, section 13).

Candidates are blocks that a robust fit does not explain (Student's t: Lange, Little and Taylor,
JASA 1989); those go without which the others are predicted far better.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.identification.linear_problem import LinearProblem
from lip_id_ros.identification.placement_search import Calibration
from lip_id_ros.identification.sample_selection import evenly

BLOCK_S, LEAST_PER_BLOCK, MOST_BLOCKS = 0.5, 8, 240
"""Length of a block, samples of one, and blocks; the larger length counts."""

LEAST_BLOCKS = 20
"""Blocks without which there is no rest to contradict."""

MOST_SAMPLES = 3000
"""Samples that are looked at, at even distances."""

MOST = 0.4
"""Share of the samples beyond which candidates are no exception."""

LEAST_GAIN, LEAST_ERRORS = 1.0, 2.0
"""
The least decrease of the logarithms of left-out mean squares, summed over joints, and its least in
standard errors.
"""

PASSES = 2


@dataclass(frozen=True)
class Episode:
    """A part of a recording that was left out."""

    recording: int
    start_s: float  # first time [s]
    end_s: float  # last time [s]
    joints: tuple[int, ...]  # whose torques are not explained


def without_disturbances(
    search: ArmSearch, calibration: Calibration
) -> tuple[ArmSearch, Calibration, list[Episode]]:
    """
    Leave out the episodes that contradict the rest, in order, and refine the placements.

    Returns what is given where there are none. Raises FitError if the data are not finite in units
    of the noise.
    """
    episodes: list[Episode] = []
    for _ in range(PASSES):
        fitter, block = search.fitter, time_blocks(search.fitter.dataset)
        disturbed = disturbed_blocks(search, calibration, block)
        if not disturbed.any():
            break
        episodes += _episodes(fitter.dataset, block, disturbed)
        kept = np.flatnonzero(~disturbed.any(axis=1)[block])
        search = search.of(fitter.of(fitter.dataset.select(kept)))
        calibration = search.recalibrated(calibration)
    return search, calibration, sorted(episodes, key=lambda each: (each.recording, each.start_s))


def halves_agree(search: ArmSearch, calibration: Calibration) -> bool:
    """
    Return whether the first and the second half of the samples are of one arm.

    They are not where one is predicted far better without the other, as when a payload was
    attached about between them; nothing says which of them is meant.
    """
    count = search.fitter.dataset.n_samples
    rows = evenly(count, MOST_SAMPLES)
    if rows.size < LEAST_PER_BLOCK * LEAST_BLOCKS:
        return True
    problem = LinearProblem.of(search, calibration, rows, np.zeros(rows.size, np.intp))
    is_late = rows >= count // 2
    gains = problem.gain(is_late), problem.gain(~is_late)
    return not any(gain.is_sure(LEAST_GAIN, LEAST_ERRORS) for gain in gains)


def time_blocks(dataset: Dataset) -> IndexArray:
    """Return the block of every sample, (N,): contiguous times of a segment, in their order."""
    new = np.diff(dataset.segment, prepend=dataset.segment[:1]) != 0
    steps = np.diff(dataset.t, prepend=dataset.t[:1])[~new]
    length = max(
        BLOCK_S, LEAST_PER_BLOCK * float(np.median(steps)), float(steps.sum()) / MOST_BLOCKS
    )
    part = np.cumsum(new)
    first = np.flatnonzero(new | (np.arange(new.size) == 0))
    number = np.floor((dataset.t - dataset.t[first][part]) / length)
    return np.cumsum(np.diff(number, prepend=0.0).astype(bool) | new)


def disturbed_blocks(search: ArmSearch, calibration: Calibration, block: IndexArray) -> BoolArray:
    """Mark (blocks, n) what contradicts the other blocks, numbered (N,) by `time_blocks`."""
    rows = evenly(block.size, MOST_SAMPLES)
    judged, number = np.unique(block[rows], return_inverse=True)
    marks = np.zeros((int(block[-1]) + 1, search.fitter.dataset.n_joints), dtype=bool)
    if judged.size < LEAST_BLOCKS:
        return marks
    # else blocks in which friction turns slowly would be taken for contacts
    problem = LinearProblem.of(search.with_memory(), calibration, rows, number)
    candidates = problem.candidates()
    out = candidates.any(axis=1)[number]
    if 0.0 < out.mean() <= MOST and problem.gain(out).is_sure(LEAST_GAIN, LEAST_ERRORS):
        marks[judged] = candidates
    return marks


def _episodes(dataset: Dataset, block: IndexArray, disturbed: BoolArray) -> Iterator[Episode]:
    """Yield runs of disturbed blocks of one recording."""
    rows = disturbed.any(axis=1)[block]
    begins = np.diff(rows, prepend=False) | (np.diff(dataset.segment, prepend=-1) != 0)
    for run in np.split(np.arange(block.size), np.flatnonzero(begins)[1:]):
        if rows[run[0]]:
            joints = np.flatnonzero(disturbed[np.unique(block[run])].any(axis=0))
            first, last = run[0], run[-1]
            yield Episode(
                int(dataset.recording[first]),
                float(dataset.t[first]),
                float(dataset.t[last]),
                tuple(joints.tolist()),
            )
