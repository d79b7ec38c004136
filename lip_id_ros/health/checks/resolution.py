"""Coarse steps and frozen values."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import Found
from lip_id_ros.health.resolution import clipped_share, longest_plateau

COARSE = {'position': 0.01, 'velocity': 0.1, 'effort': 0.1}
"""Largest step in standard deviations of the signal."""
FROZEN_S = 1.0
FROZEN_SHARE = 0.2


def coarse(evidence: Evidence) -> Iterator[Found]:
    """Find signals that know few values."""
    for signal, quanta in evidence.quanta.items():
        values = getattr(evidence.samples, signal)
        for joint, quantum in enumerate(quanta):
            if not evidence.moves(joint):
                continue
            deviation = float(np.std(values[:, joint]))
            if quantum > COARSE[signal] * deviation:
                name = evidence.names[joint]
                yield Found(
                    name,
                    f'the {signal} of {name} comes in steps of {quantum:.3g}, '
                    f'{100 * quantum / deviation:.2g} % of its standard deviation',
                )


def frozen(evidence: Evidence) -> Iterator[Found]:
    """Find efforts and velocities that stop for a while although the joint moves."""
    samples = evidence.samples
    for signal, quanta in evidence.quanta.items():
        if signal == 'position':
            continue
        for joint, name in enumerate(evidence.names):
            values = getattr(samples, signal)[:, joint]
            if values.size < 2 or np.ptp(values) == 0.0 or quanta[joint] > 0.0:
                continue
            first, last = longest_plateau(samples.t, values)
            seconds = float(samples.t[last] - samples.t[first])
            moved = float(np.ptp(samples.position[first : last + 1, joint]))
            is_end = values[first] in (values.min(), values.max()) and clipped_share(values)
            if (
                not is_end
                and seconds > FROZEN_S
                and moved > FROZEN_SHARE * evidence.reach[joint] > 0.0
            ):
                yield Found(
                    name,
                    f'the {signal} of {name} stays {values[first]:.3g} for {seconds:.3g} s from '
                    f'{samples.t[first]:.3g} s on, while its position changes by {moved:.3g}',
                )


def position_frozen(evidence: Evidence) -> Iterator[Found]:
    """Find positions that stop for a while although the recorded velocity goes on."""
    samples = evidence.samples
    if not samples.has_velocity or samples.n_samples < 2:
        return
    for joint, name in enumerate(evidence.names):
        first, last = longest_plateau(samples.t, samples.position[:, joint])
        t = samples.t[first : last + 1]
        speed = np.abs(samples.velocity[first : last + 1, joint])
        seconds = float(t[-1] - t[0])
        way = float(np.median(speed)) * seconds
        if seconds > FROZEN_S and way > max(FROZEN_SHARE * evidence.reach[joint], 0.05):
            yield Found(
                name,
                f'the position of {name} stays {samples.position[first, joint]:.3g} for '
                f'{seconds:.3g} s from {t[0]:.3g} s on, while its velocity goes on',
            )
