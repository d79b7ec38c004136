"""
Track references on a simulated Panda with learned and nominal feedforward: the paper's experiment.

The arm follows a reference under a wrong nominal model; a model is learned from that run; then
references are followed with the nominal and with the learned feedforward.
"""

from __future__ import annotations

import argparse

from benchmarks.tracking import Experiment, figures, trials
from benchmarks.tracking.figures import notes, tables
from benchmarks.tracking.report import write_report
from lip_id_ros.cli import arguments, output
from lip_id_ros.evaluation.tables import show, show_lines
from lip_id_ros.simulation.torque_controlled import panda_setup


def main(given: list[str]) -> int:
    """Simulate, learn, track, show and write."""
    args = _options(given)
    output.check_file(args.json, [], output.is_json, 'a JSON object', args.force)
    output.check_folder(args.output, args.force)
    experiment = Experiment()
    with output.progress_display() as progress:
        done = list(trials(panda_setup(), experiment, args.seeds, progress))
    result = figures(done)
    console = output.console(args.json)
    for table in tables(result):
        show(table, console)
    texts = notes(result)
    if args.output:
        page = write_report(args.output, experiment, done[0], result)
        model = page.with_name('model.npz')
        done[0].model.save(model)
        texts.append(f'Written: {page}, {model}')
    show_lines(texts, console)
    output.write_json(args.json, result.to_json())
    return 0


def _options(given: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks track', description=__doc__)
    parser.add_argument(
        '-o', '--output', metavar='DIR', help='write plots, a web page and the model there'
    )
    parser.add_argument(
        '--seeds',
        type=arguments.count,
        default=1,
        metavar='K',
        help='how many random nominal models (default: 1)',
    )
    arguments.add_json(parser)
    arguments.add_force(parser)
    return parser.parse_args(given)
