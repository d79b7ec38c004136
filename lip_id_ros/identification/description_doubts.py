"""
Where data contradict a robot description.

Reversed axes, zero positions a quarter turn off and another base are too far for a descent, and
are tried; what is near shows in how far the fit has moved the joints.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

LEAST_GAIN = 0.05
"""Mean decrease of the logarithm of the joints' residuals that a correction has to bring."""

TIE = 0.01
"""Two corrections whose decreases differ by less explain the data equally well."""

MOST_DEVIATIONS = 3.0
"""Standard deviations of the prior beyond which a joint is elsewhere than described."""

REVERSED = np.diag([1.0, -1.0, -1.0])
QUARTER_TURNS = (90.0, 180.0, -90.0)
MOUNTINGS = {
    'upside down': REVERSED,
    **{
        f'with its {axis} axis {way}': Rotation.from_euler(turn, sign * 90.0, True).as_matrix()
        for (axis, turn), (way, sign) in product(
            (('x', 'y'), ('y', 'x')), (('up', -1.0), ('down', 1.0))
        )
    },
}


@dataclass(frozen=True, eq=False)
class DescriptionDoubts:
    """What a fit says of a robot description."""

    turns: Array  # (n,), of the frame of each joint [rad]
    shifts: Array  # (n,) [m]
    deviations: Array  # (n,), the larger of both in deviations of the prior
    corrections: tuple[str, ...]  # with which the data are explained far better
    sentences: tuple[str, ...]  # all contradictions


def doubts(fitter: ArmFitter, fit: ArmFit, description: RobotDescription) -> DescriptionDoubts:
    """Compare a fit with the description that is the prior of its fitter."""
    n = len(description.joint_names)
    steps = fitter.prior.deviation(fit.chain, fit.state.numbers)[: DIRECTIONS * n]
    turns, shifts = np.linalg.norm(steps.reshape(n, 2, 3), axis=2).T
    precision = fitter.prior.precision[:DIRECTIONS]
    deviations = np.maximum(turns * precision[0], shifts * precision[3])
    corrections = _corrections(fitter, fit, description)
    return DescriptionDoubts(
        turns=turns,
        shifts=shifts,
        deviations=deviations,
        corrections=corrections,
        sentences=tuple(_sentences(description, turns, shifts, deviations, corrections)),
    )


def _sentences(
    description: RobotDescription,
    turns: Array,
    shifts: Array,
    deviations: Array,
    corrections: tuple[str, ...],
) -> Iterator[str]:
    if corrections:
        yield (
            f'{description.place} is not the description of this arm as it was recorded: the data '
            f'are explained far better where {"; ".join(corrections)}. Correct the file, the '
            'signs or the order of the joints, and fit again.'
        )
    for i in np.flatnonzero(deviations > MOST_DEVIATIONS):
        yield (
            f'The data place joint {description.joint_names[i]!r} '
            f'{np.degrees(turns[i]):.2g} degrees and {1e3 * shifts[i]:.2g} mm from where '
            f'{description.place} has it ({deviations[i]:.2g} standard deviations of the prior).'
        )


def _corrections(fitter: ArmFitter, fit: ArmFit, description: RobotDescription) -> tuple[str, ...]:
    """Return the corrections that explain the data far better, the best first."""
    search, chain, found = ArmSearch(fitter), description.chain, list[str]()
    # Until it is fitted, a right description with small errors can look like a wrong one.
    least = min(
        float(search.log_residuals(chain).mean()), fit.score / len(description.joint_names)
    )
    for _ in description.joint_names:
        trials = [
            (float(search.log_residuals(each).mean()), text, each)
            for text, each in _variants(chain, description)
        ]
        lowest, _, best = min(trials, key=lambda trial: trial[0])
        if lowest > least - LEAST_GAIN:
            break
        chain, least = best, lowest
        # A spherical shoulder that turns back looks like one whose next joint is half a turn off.
        found.append(', or '.join(text for each, text, _ in trials if each < lowest + TIE))
    return tuple(found)


def _variants(chain: Chain, description: RobotDescription) -> Iterator[tuple[str, Chain]]:
    """Yield chains with one usual mistake corrected."""
    for i, name in enumerate(description.joint_names):
        yield f'joint {name!r} moves the other way', reversed_axis(chain, i)
        for angle in () if chain.prismatic[i] else QUARTER_TURNS:
            turn = Rotation.from_euler('z', angle, degrees=True).as_matrix()
            text = f'the zero position of joint {name!r} is turned by {angle:g} degrees'
            yield text, _with_rotation(chain, i, chain.rotations[i] @ turn)
    for text, turn in MOUNTINGS.items():
        yield f'the base is mounted {text}', _with_rotation(chain, 0, turn @ chain.rotations[0])


def reversed_axis(chain: Chain, joint: int) -> Chain:
    """Return the arm whose joint moves the other way."""
    rotations, translations = chain.rotations.copy(), chain.translations.copy()
    rotations[joint] = rotations[joint] @ REVERSED
    if joint + 1 < len(rotations):
        rotations[joint + 1] = REVERSED @ rotations[joint + 1]
        translations[joint + 1] = REVERSED @ translations[joint + 1]
    return chain._replace(rotations=rotations, translations=translations)


def _with_rotation(chain: Chain, joint: int, rotation: Array) -> Chain:
    rotations = chain.rotations.copy()
    rotations[joint] = rotation
    return chain._replace(rotations=rotations)
