"""
Real arms that are followed: errors of the fit and of what is served, and payloads that are none.

The first recording is fitted (of a single one, the first half), and the others are followed in
the order of their time. None of these arms takes a payload up.

"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import time

import numpy as np

from benchmarks._real import ARMS, OTHERS
from benchmarks._results import Row
from lip_id_ros.adaptation.adaptation import Adaptation, Followed
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.preprocessing import for_training, preprocess
from lip_id_ros.settings import PreprocessingSettings
from lip_id_ros.workflow.fit import fit

PAUSE_S = 60.0
"""Between two recordings, where it is not known."""


def main(arguments: list[str]) -> int:
    """Print a line for each recording, and one for each arm."""
    names = [*ARMS, *OTHERS]
    parser = argparse.ArgumentParser(prog='benchmarks follow_real', description=__doc__)
    parser.add_argument('data', type=Path, help='folder of the recordings')
    parser.add_argument('--arms', nargs='+', choices=names, default=names)
    options = parser.parse_args(arguments)
    for name in options.arms:
        try:
            first, others = recordings(name, options.data)
            for line in follow(name, first, others):
                print(json.dumps(line), flush=True)
        except LipIdError as error:
            print(json.dumps({'arm': name, 'error': str(error)}), flush=True)
    return 0


def recordings(name: str, folder: Path) -> tuple[Dataset, list[Dataset]]:
    """Return samples to fit, and recordings to follow."""
    raw = (ARMS[name].load if name in ARMS else OTHERS[name])(folder)
    first, *others = (preprocess(each, recording=raw.recording) for each in raw.samples)
    if not others:
        first, last = first.split(0.5)
        others = [last]
    return for_training(first, PreprocessingSettings(), ARTICULATED), others


def follow(name: str, first: Dataset, others: list[Dataset]) -> list[Row]:
    """Follow recordings, and return errors of each, and a row for the arm."""
    adaptation, at, count, seconds = Adaptation(fit(first)), 0.0, 0, 0.0
    lines: list[Row] = []
    for number, data in enumerate(others, start=2):
        begun = time.process_time()
        found = adaptation.update(data.t - data.t[0] + at, data.q, data.dq, data.ddq, data.tau)
        seconds += time.process_time() - begun
        count += data.n_samples
        at += float(data.t[-1] - data.t[0]) + PAUSE_S
        lines.append(_line(name, number, data, found))
    arm = {
        'arm': name,
        'joints': first.n_joints,
        'largest_ratio': max(line['ratio'] for line in lines),
        'minutes': round((at - PAUSE_S * len(others)) / 60.0, 1),
        'payloads': [each.sentence() for each in adaptation.payload_events],
        'forgotten': adaptation.n_forgotten,
        'us_per_sample': round(1e6 * seconds / count),
    }
    return [*lines, arm]


def _line(name: str, number: int, data: Dataset, found: Followed) -> Row:
    """Return the errors of a recording, and that of what is served in that of the fit."""
    frozen, served = (
        float(np.nanmean(nmse_percent(tau, data.tau))) for tau in (found.frozen, found.served)
    )
    within = np.abs(data.tau - found.tau) <= 2.0 * found.std
    return {
        'arm': name,
        'recording': number,
        'frozen': round(frozen, 4),
        'served': round(served, 4),
        'ratio': round(served / frozen, 4),
        'trusted_percent': round(100.0 * float(found.trusted.mean())),
        'within_two_std_percent': round(100.0 * float(within.mean()), 1),
    }
