"""The action of `serve` before a real controller: what it adds, and whether a goal is lost."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import tempfile

from benchmarks._cells import measured, show
from benchmarks.serve_rate import fitted, MIDDLEWARES

WAYS = ('direct', 'through serve')
LATENCIES = {
    'middleware': 'middleware',
    'load': 'load',
    'serve CPU ms per goal': 'CPU of serve ms per goal',
} | {
    f'{what} {way}{share} ms': f'{what} {way}{share} ms'
    for what in ('begun', 'rejected')
    for way in WAYS
    for share in ('', ' 90 %')
}
COUNTS = {
    'middleware': 'middleware',
    **{
        f'{who} {how}': f'{who}: {how}'
        for who in ('client', 'serve')
        for how in ('succeeded', 'canceled', 'aborted')
    },
    'serve refused': 'serve: refused',
    'goals per second': 'goals per s',
    'adds up': 'adds up',
}


def main(arguments: list[str]) -> int:
    """Measure every middleware, print two tables; 1 if the counts of one do not add up."""
    parser = argparse.ArgumentParser(prog='benchmarks goals', description=__doc__)
    parser.add_argument('--points', type=int, default=200, help='of a plan whose way is timed')
    parser.add_argument('--repeats', type=int, default=100, help='timed goals of each way')
    parser.add_argument('--goals', type=int, default=1000, help='with cancels and preemptions')
    parser.add_argument('--middlewares', nargs='+', default=MIDDLEWARES[:1])
    parser.add_argument('--model', help='of the Panda; left out: one is fitted')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        model = options.model or fitted(folder)
        request = {name: getattr(options, name) for name in ('points', 'repeats', 'goals')}
        rows = [
            measured('benchmarks._goal_client', {**request, 'model': model, 'middleware': each})
            for each in options.middlewares
        ]
    show(f'{options.repeats} goals of {options.points} points', LATENCIES, rows, 200)
    show(f'{options.goals} goals, cancelled and preempted at random', COUNTS, rows, 200)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return int(not all(row['adds up'] for row in rows))
