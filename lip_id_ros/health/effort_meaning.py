"""
Find the meaning of recorded efforts by how well the links of an arm explain them.

Links in places that are searched for explain efforts as recorded, without gravity, with other
scales and signs, and in other orders. What explains them clearly better is proposed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lip_id_ros.dataset import Dataset
from lip_id_ros.health.finding import Finding, Severity
from lip_id_ros.identification.effort_scale import (
    alike,
    as_recorded,
    EffortScale,
    find_effort_scale,
    from_revolutions,
    may_be_revolutions,
)
from lip_id_ros.progress import Progress, silent

BETTER = 2.0
"""
By this factor residuals must be smaller for another reading of the efforts to be proposed: in the
geometric mean over joints, or at one joint where the reading then explains all of them well.
"""

NO_WORSE = 1.05
"""By this factor they may be larger without gravity for gravity to be missing."""


def diagnose_effort(
    dataset: Dataset, seed: int = 0, progress: Progress = silent
) -> tuple[Finding, ...]:
    """
    Find out whether efforts are the torques of an arm, and what they may be instead.

    Every joint moves. Empty where efforts are torques, or nothing that was tried is clearly
    better.
    """
    recorded = as_recorded(dataset, seed, progress)
    findings: list[Finding] = []
    if not dataset.gravity_compensated and not recorded.bears_weight:
        without = replace(dataset, gravity_compensated=True)
        other = as_recorded(without, seed, progress)
        if other.mean_residual <= NO_WORSE * recorded.mean_residual:
            findings.append(_gravity(other, recorded))
            dataset, recorded = without, other
    return (*findings, *_readings(dataset, recorded, seed, progress))


def _readings(
    dataset: Dataset, recorded: EffortScale, seed: int, progress: Progress
) -> Iterator[Finding]:
    if np.all(recorded.scale < 0.0) and np.sum(recorded.friction) < 0.0:
        yield _turned(dataset, range(dataset.n_joints), recorded, recorded)
        if recorded.explains:
            return
    if recorded.explains and not recorded.is_odd:
        return
    if not recorded.explains and may_be_revolutions(dataset):
        turned = as_recorded(from_revolutions(dataset), seed, progress)
        if _is_better(turned, recorded):
            yield _revolutions(turned, recorded)
            return
    scaled = find_effort_scale(dataset, recorded, seed, progress)
    if recorded.explains and not _is_better(scaled, recorded):
        return
    if not (scaled.explains and alike(np.abs(scaled.scale))):
        order, ordered = _best_order(dataset, seed, progress)
        if ordered.mean_residual <= scaled.mean_residual:
            if _is_better(ordered, recorded):
                yield _order(order, ordered, recorded)
            return
    if _is_better(scaled, recorded):
        yield from _signs_and_scales(dataset, scaled, recorded)


def _signs_and_scales(
    dataset: Dataset, scaled: EffortScale, recorded: EffortScale
) -> Iterator[Finding]:
    turned = np.flatnonzero(scaled.scale < 0.0)
    if turned.size:
        yield _turned(dataset, turned.tolist(), scaled, recorded)
    if not alike(np.abs(scaled.scale)):
        yield _scaled(dataset, scaled, recorded)


def _is_better(other: EffortScale, recorded: EffortScale) -> bool:
    if BETTER * other.mean_residual <= recorded.mean_residual:
        return True
    return other.explains and recorded.gain(other) > BETTER


def orders(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return other orders of joints: alphabetical, reversed, and with neighbours swapped."""
    tried = [tuple(sorted(names)), tuple(reversed(names))]
    for k in range(len(names) - 1):
        tried.append((*names[:k], names[k + 1], names[k], *names[k + 2 :]))
    return [order for order in dict.fromkeys(tried) if order != tuple(names)]


def _best_order(
    dataset: Dataset, seed: int, progress: Progress
) -> tuple[tuple[str, ...], EffortScale]:
    tried = [
        (order, as_recorded(dataset.with_joints(order), seed, progress))
        for order in orders(dataset.joint_names)
    ]
    nothing = (dataset.joint_names, as_recorded(dataset, seed + 1, progress))
    return min([nothing, *tried], key=lambda each: each[1].mean_residual)


def _gravity(without: EffortScale, recorded: EffortScale) -> Finding:
    return _finding(
        'effort_without_gravity',
        f'links that weigh nothing explain the efforts as well as links with weight '
        f'({_left(without)} of their variation is left, and {_left(recorded)}): gravity seems to '
        'have been taken out of them, or no joint moves against it; set '
        'recording.gravity_compensated to true if the driver takes gravity out',
    )


def _revolutions(turned: EffortScale, recorded: EffortScale) -> Finding:
    return _finding(
        'position_revolutions',
        f'with positions in revolutions, links leave {_left(turned)} of the variation of the '
        f'efforts, in rad {_left(recorded)}; publish positions in rad',
    )


def _turned(
    dataset: Dataset, joints: Sequence[int], scaled: EffortScale, recorded: EffortScale
) -> Finding:
    names = ', '.join(dataset.joint_names[joint] for joint in joints)
    return _finding(
        'effort_sign',
        f'with the sign of the effort turned at {names}, one set of links leaves {_left(scaled)} '
        f'of the variation of the efforts, as recorded {_left(recorded)}, and friction brakes; '
        'give these joints a negative value in recording.effort_scale',
    )


def _scaled(dataset: Dataset, scaled: EffortScale, recorded: EffortScale) -> Finding:
    scales = ', '.join(f'{value:.3g}' for value in 1.0 / scaled.scale)
    return _finding(
        'effort_scale',
        f'with a factor of its own for every joint, one set of links leaves {_left(scaled)} of '
        f'the variation of the efforts, as recorded {_left(recorded)}: they seem to be motor '
        f'currents; give motor constant times gear ratio as recording.effort_scale, or '
        f'[{scales}] for torques and masses up to a common factor',
    )


def _order(order: Sequence[str], ordered: EffortScale, recorded: EffortScale) -> Finding:
    return _finding(
        'joint_order_by_torque',
        f'with the joints in the order {", ".join(order)}, links leave {_left(ordered)} of the '
        f'variation of the efforts, in the order as recorded {_left(recorded)}; see whether that '
        'is the order from base to tip, and give it as recording.joints',
    )


def _left(scale: EffortScale) -> str:
    return f'{100.0 * scale.mean_residual:.2g} %'


def _finding(code: str, text: str) -> Finding:
    return Finding(code, Severity.WARNING.value, '', f'{text}.')
