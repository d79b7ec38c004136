"""
How often `lip_id inspect` and `lip_id fit` find defects of three sizes in simulated recordings.

And what they find in sound ones, which have other rates, lengths and noise, and in real ones.

"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks._defects import CAUTIONS, DEFECTS, JOINTS, Recorded, Sensors
from benchmarks._real import ARMS, OTHERS
from lip_id_ros.evaluation.cautions import fit_cautions
from lip_id_ros.health import evidence_of, examine
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings
from lip_id_ros.workflow.fit import fit


def main(arguments: list[str]) -> int:
    """Print a line for the false alarms, and one for each defect with its three counts."""
    parser = argparse.ArgumentParser(prog='benchmarks defects', description=__doc__)
    parser.add_argument('--arms', type=int, default=20)
    parser.add_argument('--fits', type=int, default=0, help='arms whose recordings are fitted too')
    parser.add_argument('--joints', type=int, nargs='*', default=[4, 7], choices=JOINTS)
    parser.add_argument('--only', nargs='+', choices=tuple(DEFECTS), default=tuple(DEFECTS))
    parser.add_argument('--sound', type=int, default=200, help='sound recordings of any kind')
    parser.add_argument('--data', type=Path, help='folder of real recordings')
    options = parser.parse_args(arguments)
    for n_joints in options.joints:
        arms = [Recorded.of(seed, n_joints) for seed in range(max(options.arms, options.fits))]
        right = {name: DEFECTS[name][2] for name in options.only}
        for line in lines('inspect', found, arms[: options.arms], right):
            print(line, flush=True)
        right = {name: {CAUTIONS[name]} for name in options.only if name in CAUTIONS}
        for line in lines('fit', cautions, arms[: options.fits], right):
            print(line, flush=True)
    alarms = Counter(each for seed in range(options.sound) for each in found(sound(seed)))
    print(f'inspect of {options.sound} sound recordings: {dict(alarms)}', flush=True)
    for line in real(options.data) if options.data else ():
        print(line, flush=True)
    return 0


def sound(seed: int) -> JointSamples:
    """Return a sound recording of an arm of 4 to 7 joints, with any usual sensors."""
    rng = np.random.default_rng((seed, 2))
    n_joints = int(rng.choice(JOINTS))
    return Recorded.of(seed, n_joints, Sensors.random(rng)).samples


def real(folder: Path) -> Iterator[str]:
    """Yield for each kind of real recording how many there are, and findings in them."""
    for name, load in {**{name: arm.load for name, arm in ARMS.items()}, **OTHERS}.items():
        raw = load(folder)
        codes = Counter(code for each in raw.samples for code in found(each, raw.recording))
        yield f'{name}: {len(raw.samples)} recordings, {dict(codes)}'


def lines(
    verb: str,
    judge: Callable[[JointSamples], set[str]],
    arms: Sequence[Recorded],
    right: Mapping[str, set[str]],
) -> Iterator[str]:
    """Yield the rows of a table in Markdown: what is said of sound recordings, and of others."""
    alarms = Counter(each for arm in arms for each in judge(arm.samples))
    yield f'{verb} of {len(arms)} arms, false alarms: {dict(alarms)}'
    for name, names in right.items():
        spoil, sizes, _ = DEFECTS[name]
        cells = []
        for size in sizes:
            hits = sum(bool(names & judge(spoil(arm, size))) for arm in arms)
            cells.append(f'{size:g}: {hits}')
        yield f'| {name} | {" | ".join(cells)} |'


def found(samples: JointSamples, recording: RecordingSettings | None = None) -> set[str]:
    """Return the codes of errors and warnings."""
    findings = examine(evidence_of(samples, recording))
    return {finding.code for finding in findings if finding.severity != 'note'}


def cautions(samples: JointSamples) -> set[str]:
    """Return what a fit reports: parts of known sentences, and other sentences whole."""
    model = fit(preprocess(samples))
    texts = fit_cautions(model)
    return {next((part for part in CAUTIONS.values() if part in text), text) for text in texts}
