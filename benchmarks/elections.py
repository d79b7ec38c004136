"""
How often friction terms are elected, and faults of efforts diagnosed, on simulated arms.

Arms of three joints; `docs/accuracy.md` has the counts of 20 seeds.

"""

from __future__ import annotations

import argparse
from pathlib import Path
import time

import numpy as np
from rich.console import Console
from rich.table import Table

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
from lip_id_ros.identification.friction_election import elect_friction

LINK_STD = np.tile([5.0, *[2.0] * 3, *[1.0] * 7], (N_JOINTS, 1))
PLAIN = {'viscous', 'Coulomb', 'offset'}


def main(arguments: list[str]) -> int:
    """Count, and print both tables."""
    parser = argparse.ArgumentParser(prog='benchmarks elections', description=__doc__)
    parser.add_argument('--seeds', type=int, default=20)
    parser.add_argument('--only', choices=('friction', 'efforts'))
    parser.add_argument('--data', type=Path, help='folder of real recordings, for false alarms')
    options = parser.parse_args(arguments)
    console = Console(width=100)
    if options.only != 'efforts':
        console.print(_friction(options.seeds))
    if options.only != 'friction':
        console.print(_efforts(options.seeds))
    if options.data is not None:
        console.print(_alarms(options.data))
    return 0


def elected(seed: int, extra: Terms) -> list[set[str]]:
    """Return what is elected beside the usual friction, joint by joint."""
    arm, dataset = recording(seed, extra)
    got = elect_friction(dataset, arm.chain, LINK_STD)
    return [set(names) - PLAIN for names in got.friction.names()]


def _friction(n_seeds: int) -> Table:
    table = Table('present', 'elected', 'others elected', 'CPU s', title=f'{n_seeds} seeds')
    others: list[set[str]] = [set() for _ in range(N_JOINTS)]
    cases: dict[str, tuple[Terms, list[set[str]]]] = {'nothing': ([], others)}
    for name in PRESENT:
        cases[name] = present(name), [{name} if j == JOINT else set() for j in range(N_JOINTS)]
    pair = [{f'{term} coupled with joint {k}' for term in ('viscous', 'Coulomb')} for k in (3, 2)]
    cases['coupled motor'] = coupled(), [set(), *pair]
    cases['coupled efforts'] = coupled_efforts(), [set(), {'torque coupled with joint 3'}, set()]
    for name, (extra, expected) in cases.items():
        started = time.process_time()
        found = [elected(seed, extra) for seed in range(n_seeds)]
        pairs = [list(zip(names, expected, strict=True)) for names in found]
        right = sum(all(there <= mine for mine, there in each) for each in pairs)
        wrong = sum(len(mine - there) for each in pairs for mine, there in each)
        table.add_row(name, f'{right}', f'{wrong}', f'{time.process_time() - started:.0f}')
    return table


def _efforts(n_seeds: int) -> Table:
    table = Table('fault', 'diagnosed', 'missed', 'CPU s', title=f'{n_seeds} seeds')
    for fault, codes in FAULTS.items():
        started = time.process_time()
        missed = {}
        for seed in range(n_seeds):
            findings = diagnose_effort(faulty(fault, seed))
            if (got := tuple(each.code for each in findings)) != codes:
                missed[seed] = ', '.join(got) or 'nothing'
        seconds = time.process_time() - started
        name = fault.__name__.replace('_', ' ')
        table.add_row(name, f'{n_seeds - len(missed)}', f'{missed or ""}', f'{seconds:.0f}')
    return table


def _alarms(folder: Path) -> Table:
    table = Table('recording', 'findings', 'CPU s')
    for name, arm in ARMS.items():
        started = time.process_time()
        findings = diagnose_effort(concatenate(arm.datasets(folder)))
        codes = ', '.join(each.code for each in findings)
        table.add_row(name, codes, f'{time.process_time() - started:.0f}')
    return table
