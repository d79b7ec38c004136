"""
How often friction terms are selected, and faults of efforts diagnosed, on simulated arms.

Arms of three joints; `accuracy.md` has the counts of 20 seeds.

"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
import time

import numpy as np

from benchmarks._drives import (
    coupled,
    coupled_efforts,
    FAULTS,
    faulty,
    JOINT,
    N_JOINTS,
    PRESENT,
    present,
    recording,
    Terms,
)
from benchmarks._real import ARMS
from lip_id_ros.dataset import concatenate
from lip_id_ros.health.effort_meaning import diagnose_effort
from lip_id_ros.identification.friction_selection import select_friction

LINK_STD = np.tile([5.0, *[2.0] * 3, *[1.0] * 7], (N_JOINTS, 1))
PLAIN = {'viscous', 'Coulomb', 'offset'}

Expected = list[set[str]]


def main(arguments: list[str]) -> int:
    """Print a line for each term, each fault, and each real recording."""
    parser = argparse.ArgumentParser(prog='benchmarks selections', description=__doc__)
    parser.add_argument('--seeds', type=int, nargs='+', default=list(range(20)))
    parser.add_argument('--only', choices=('friction', 'efforts', 'alarms'))
    parser.add_argument('--cases', nargs='+', help='only these terms, faults or recordings')
    parser.add_argument('--data', type=Path, default=Path('../shared/data'))
    options = parser.parse_args(arguments)
    tables: dict[str, Callable[[], Iterator[str]]] = {
        'friction': lambda: _friction(options.seeds, options.cases),
        'efforts': lambda: _efforts(options.seeds, options.cases),
        'alarms': lambda: _alarms(options.data, options.cases),
    }
    for name, lines in tables.items():
        if options.only in (None, name):
            for line in lines():
                print(line, flush=True)
    return 0


def selected(seed: int, extra: Terms) -> list[set[str]]:
    """Return what is selected beside the usual friction, joint by joint."""
    arm, dataset = recording(seed, extra)
    got = select_friction(dataset, arm.chain, LINK_STD)
    return [set(names) - PLAIN for names in got.friction.names()]


def _cases() -> dict[str, tuple[Terms, Expected]]:
    """Return terms that are there, and what should be selected for each joint."""
    cases: dict[str, tuple[Terms, Expected]] = {'nothing': ([], [set()] * N_JOINTS)}
    for name in PRESENT:
        cases[name] = present(name), [{name} if j == JOINT else set() for j in range(N_JOINTS)]
    pair = [{f'{term} coupled with joint {k}' for term in ('viscous', 'Coulomb')} for k in (3, 2)]
    cases['coupled motor'] = coupled(), [set(), *pair]
    cases['coupled efforts'] = coupled_efforts(), [set(), {'torque coupled with joint 3'}, set()]
    return cases


def _friction(seeds: list[int], only: list[str] | None) -> Iterator[str]:
    for name, (extra, expected) in _cases().items():
        if only and name not in only:
            continue
        started = time.process_time()
        missed, others = [], Counter[str]()
        for seed in seeds:
            pairs = list(zip(selected(seed, extra), expected, strict=True))
            if not all(there <= mine for mine, there in pairs):
                missed.append(seed)
            for mine, there in pairs:
                others.update(mine - there)
        yield _line(name, len(seeds) - len(missed), len(seeds), missed, dict(others), started)


def _efforts(seeds: list[int], only: list[str] | None) -> Iterator[str]:
    for fault, codes in FAULTS.items():
        name = fault.__name__.replace('_', ' ')
        if only and name not in only:
            continue
        started = time.process_time()
        missed = {}
        for seed in seeds:
            findings = diagnose_effort(faulty(fault, seed))
            if (got := tuple(each.code for each in findings)) != codes:
                missed[seed] = ', '.join(got) or 'nothing'
        yield _line(name, len(seeds) - len(missed), len(seeds), missed, {}, started)


def _alarms(folder: Path, only: list[str] | None) -> Iterator[str]:
    for name, arm in ARMS.items():
        if only and name not in only:
            continue
        started = time.process_time()
        findings = diagnose_effort(concatenate(arm.datasets(folder)))
        yield f'{name}: {[each.text for each in findings]}; {_cpu(started)}'


def _line(
    name: str, right: int, of: int, missed: object, others: dict[str, int], started: float
) -> str:
    return f'{name}: {right} of {of}; missed {missed}; others {others}; {_cpu(started)}'


def _cpu(started: float) -> str:
    return f'{time.process_time() - started:.0f} CPU s'
