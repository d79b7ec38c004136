"""
Track references on a simulated Panda with learned and nominal feedforward: the paper's experiment.

The arm follows a reference under a wrong nominal model; a model is learned from that run; then
references are followed with the nominal and with the learned feedforward.
"""

from __future__ import annotations

import argparse

from lip_id_ros.cli import arguments

HELP = 'track references on a simulated arm with learned and with nominal feedforward'
EPILOG = """\
examples:
  lip_id track -o tracking              one nominal model; pictures and page in tracking/
  lip_id track -o tracking --seeds 5    five random nominal models

Needs pinocchio: `pip install lip_id_ros[sim]`.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the verb."""
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


def run(args: argparse.Namespace) -> None:
    """Simulate, learn, track, show and write."""
    from lip_id_ros.cli import output
    from lip_id_ros.evaluation.tables import show, show_lines
    from lip_id_ros.simulation.panda_drives import panda_setup
    from lip_id_ros.tracking import Experiment, figures, trials
    from lip_id_ros.tracking.figures import notes, tables
    from lip_id_ros.tracking.report import write_report

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
